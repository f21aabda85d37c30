"""The slew task under Gymnasium."""
