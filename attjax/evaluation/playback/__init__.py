"""The web page that replays slews in 3-D."""
