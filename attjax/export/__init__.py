"""Policies for flight software: C99, ONNX, StableHLO."""
