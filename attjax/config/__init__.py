"""What defines a run, and how users say it: settings, presets, files, arguments. No JAX."""
