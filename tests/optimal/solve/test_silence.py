"""Output of a solver, and its receiver."""

import sys
import threading

from armdyn.optimal.solve.ipopt import silence


def test_this_thread_is_not_heard_and_others_are(capsys):
    with silence(verbose=False):
        sys.stdout.write("mine\n")
        thread = threading.Thread(target=lambda: sys.stdout.write("theirs\n"))
        thread.start()
        thread.join()
        sys.stderr.write("mine\n")
    sys.stdout.write("after\n")
    assert capsys.readouterr() == ("theirs\nafter\n", "")


def test_who_keeps_the_stream_is_heard_afterwards(capsys):
    with silence(verbose=False):
        kept = sys.stderr
    assert sys.stderr is not kept
    kept.write("heard")
    assert capsys.readouterr().err == "heard"


def test_verbose_changes_nothing():
    before = sys.stdout, sys.stderr
    with silence(verbose=True):
        assert (sys.stdout, sys.stderr) == before
