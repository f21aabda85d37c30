"""Judge an attitude controller: the same as ``attjax eval``."""

import sys

from attjax.commands.eval import main

if __name__ == "__main__":
    sys.exit(main())
