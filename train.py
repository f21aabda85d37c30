"""Train a neural attitude controller: the same as ``attjax train``."""

import sys

from attjax.commands.train import main

if __name__ == "__main__":
    sys.exit(main())
