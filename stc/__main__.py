"""``python -m stc`` is the command ``stc``."""

from stc.cli.main import main

main()
