"""Signals that ask a run to stop where it can go on."""

import signal
import threading


class StopSignals:
    """Notes signals that ask to stop, for the work to end where it can go on; a context manager.

    They are SIGINT and SIGTERM; SIGHUP of a terminal that is gone; and SIGUSR1, SIGUSR2 and
    SIGXCPU, by which batch systems tell that time runs out. The latter four stay ignored where
    they were, as after ``nohup``. A second SIGINT or SIGTERM ends the process at once; the others
    come in pairs by themselves. Beside the main thread, where Python hears no signals, it notes
    none.

    Attributes:
        received: the first signal's number, None before.
    """

    AT_ONCE = ("SIGINT", "SIGTERM")
    BY_MACHINES = ("SIGHUP", "SIGUSR1", "SIGUSR2", "SIGXCPU")  # of which Windows has none
    received: int | None = None

    def __enter__(self):
        self._at_once = _signals(self.AT_ONCE)
        machines = [s for s in _signals(self.BY_MACHINES) if signal.getsignal(s) != signal.SIG_IGN]
        in_main = threading.current_thread() is threading.main_thread()
        heard = [*self._at_once, *machines] if in_main else []
        self._before = {number: signal.signal(number, self._note) for number in heard}
        return self

    def __exit__(self, *_):
        for number, handler in self._before.items():
            # None: a handler that was not Python's, which it cannot bring back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def _note(self, number, _):
        self.received = self.received or number
        for each in self._at_once:
            signal.signal(each, signal.SIG_DFL)


def _signals(names):
    return [getattr(signal, name) for name in names if hasattr(signal, name)]
