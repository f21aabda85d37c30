"""What decides: classical laws, the inputs of networks, and the guard of the rate limit."""
