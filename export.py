"""Write a trained attitude controller for flight software: the same as ``attjax export``."""

import sys

from attjax.commands.export import main

if __name__ == "__main__":
    sys.exit(main())
