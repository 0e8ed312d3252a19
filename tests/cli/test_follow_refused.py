"""The command follow: requests and files that it refuses."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import commands
import pytest

run = partial(commands.run, "follow")

BAD = {
    "unknown robot": (["d2", "--task", "drill"], "known: d1"),
    "unknown task": (["d1", "--task", "dril"], "did you mean 'drill'"),
    "how a file looks": (["d1", "--task", "mill"], "first line is t,x,y,z or t,x,y,z,ax,ay,az"),
    "no tasks by name": (["rpa3t", "--task", "drill"], "known: none; or a CSV file"),
    "no such file": (["d1", "--task", "none.csv"], "there is no file none.csv"),
    "a folder": (["d1", "--task", "/"], "is a folder"),
    "unknown objective": (["d1", "--task", "drill", "--objective", "joy"], "known: singularity"),
    "unknown method": (["d1", "--task", "drill", "--method", "luck"], "known: gradient, path"),
    "unknown lock": (["d1", "--task", "drill", "--lock", "q7"], "--lock: unknown input 'q7'"),
    "lock twice": (["d1", "--task", "drill", "--lock", "q1", "--lock", "q1=1"], "given twice"),
    "lock that is no number": (["d1", "--task", "drill", "--lock", "q1=a"], "'a' is not a finite"),
    "two locks": (
        ["d1", "--task", "drill", "--lock", "q1", "--lock", "q2"],
        "q1, q2 cannot all be locked: the outputs x y z rx rz leave 1 freedom",
    ),
    "lock and compare": (["d1", "--task", "drill", "--lock", "q1", "--compare"], "leave out"),
    "limit without ends": (["d1", "--task", "drill", "--limit", "q1=1"], "expected q1=LO:HI"),
    "limit without value": (["d1", "--task", "drill", "--limit", "q1"], "expected q1=LO:HI"),
    "limits that fall": (["d1", "--task", "drill", "--limit", "q1=1:0"], "1 is not below 0"),
    "limit of nothing": (["d1", "--task", "drill", "--limit", "p=0:1"], "unknown input 'p'"),
    "no speed": (["d1", "--task", "drill", "--speed-limit", "0"], "not above zero"),
    "no speed of one": (["d1", "--task", "drill", "--speed-limit", "q1=-1"], "not above zero"),
    "speed that is no number": (["d1", "--task", "drill", "--speed-limit", "q1"], "'q1'"),
    "two speeds": (
        ["d1", "--task", "drill", "--speed-limit", "1", "--speed-limit", "2"],
        "one number for all",
    ),
    "unknown output": (["d1", "--task", "drill", "--outputs", "x q"], "unknown output 'q'"),
    "nothing to compare": (
        ["d1", "--task", "drill", "--outputs", "x y z rx ry rz", "--compare"],
        "no redundant motion",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_refusals_are_one_line(what: str, tmp_path: Path) -> None:
    words, expected = BAD[what]
    done = run(*words, "--out", str(tmp_path / "out"))
    assert done.exit_code == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("closedchain: ")
    assert expected in line


TEXTS = {
    "no columns": ("a,b\n1,2\n", "no column t, x, y, z"),
    "no number": ("t,x,y,z\n0,0,-1,low\n", "line 2: not a number in column z: 'low'"),
    "a value too few": ("t,x,y,z\n0,0,-1\n", "line 2: not a number in column z: ''"),
    "not finite": ("t,x,y,z\n0,0,-1,0\n1,nan,-1,0\n", "line 3: not a finite number in column x"),
    "half an axis": ("t,x,y,z,ax\n0,0,-1,0,1\n", "a tool axis takes ax ay az, and only ['ax']"),
    "no rows": ("t,x,y,z\n", "no rows"),
    "times that fall": ("t,x,y,z\n1,0,-1,0\n0,0,-1,0\n", "task.csv: times must rise"),
    "no text": ("t,x\udcff", "no UTF-8 text"),
}


@pytest.mark.parametrize("what", TEXTS)
def test_wrong_files_are_refused(what: str, tmp_path: Path) -> None:
    text, expected = TEXTS[what]
    file = tmp_path / "task.csv"
    file.write_text(text, errors="surrogateescape")
    done = run("d1", "--task", str(file), "--out", str(tmp_path / "out"))
    assert done.exit_code == 1
    assert expected in done.stderr
    assert not (tmp_path / "out").exists()
