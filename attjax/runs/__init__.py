"""Training runs: what they are made of, what they leave behind, what they show."""
