"""The slew task for other libraries."""
