"""A file of rows that is killed, cut off, damaged, or of another question."""

import json
import math

import pytest

import armdyn as ad
from armdyn.errors import FileError, ResultError
from armdyn.studies.plants.rows import RunRow, named, read_rows, row_file

ASKED = {"format": "rows-1", "loop": {"rate": 1000.0, "delay": 1}, "seed": 0}


def row(k, settled=0.25):
    draw = ad.Plants(coulomb=(0, 1)).draw(k, 2)
    return RunRow(k, draw, "settled", settled, 0.1, 0.2, 0.5, 1 / 3, None, (1e-5, math.pi))


def written(path, count):
    with row_file(path, ASKED) as rows:
        for k in range(count):
            rows.append(row(k))
    return path


def test_rows_come_back_as_they_were_by_their_numbers(tmp_path):
    path = tmp_path / "new folder" / "rows.jsonl"
    with row_file(path, ASKED) as rows:
        assert rows.rows == ()
        for k in (4, 0, 2):
            rows.append(row(k))
    assert read_rows(path, ASKED) == (row(0), row(2), row(4))
    assert json.loads(path.read_text().splitlines()[0]) == ASKED


def test_a_row_is_on_disk_as_soon_as_it_is_appended(tmp_path):
    path = tmp_path / "rows.jsonl"
    with row_file(path, ASKED) as rows:
        for k in range(3):
            rows.append(row(k))
            assert len(read_rows(path, ASKED)) == k + 1


def test_a_file_cut_off_anywhere_goes_on_without_a_row_lost_or_doubled(tmp_path):
    path = written(tmp_path / "rows.jsonl", 3)
    content = path.read_bytes()
    ends = [i + 1 for i, byte in enumerate(content) if byte == ord("\n")]
    for cut in range(len(content) + 1):
        path.write_bytes(content[:cut])
        whole = max(sum(end <= cut for end in ends) - 1, 0)
        with row_file(path, ASKED) as rows:
            assert rows.rows == tuple(row(k) for k in range(whole))
            for k in range(whole, 3):
                rows.append(row(k))
        assert path.read_bytes() == content


def test_another_question_is_refused_and_says_what_differs(tmp_path):
    path = written(tmp_path / "rows.jsonl", 2)
    before = path.read_bytes()
    other = {**ASKED, "loop": {"rate": 500.0, "delay": 1}, "seed": 7}
    message = r"answer another question: loop.rate is 1000.0 there and 500.0 here; seed is 0 there and 7 here"
    with pytest.raises(ResultError, match=message), row_file(path, other):
        pass
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: ["no JSON", *lines[1:]], "line 1 is not JSON"),
        (lambda lines: ['{"format": "other"}', *lines[1:]], "no file of rows of format rows-1"),
        (lambda lines: [*lines[:2], "{", *lines[2:]], "line 3 is no row"),
        (lambda lines: [*lines, lines[1]], "line 5 has row 0 a second time"),
        (
            lambda lines: [*lines[:1], lines[1].replace("0.25", "NaN"), *lines[2:]],
            "line 2 is no row .NaN is not finite",
        ),
        (lambda lines: [*lines[:1], lines[1].replace("0.25", '"soon"'), *lines[2:]], "line 2 is no row .a number is"),
        (lambda lines: [*lines[:1], lines[1].replace('"noise"', '"sound"'), *lines[2:]], "line 2 is no row"),
    ],
)
def test_a_damaged_file_is_refused_by_its_line_and_left_as_it_is(tmp_path, change, message):
    path = written(tmp_path / "rows.jsonl", 3)
    path.write_text("".join(f"{line}\n" for line in change(path.read_text().splitlines())))
    before = path.read_bytes()
    with pytest.raises(ResultError, match=message), row_file(path, ASKED):
        pass
    assert path.read_bytes() == before


def test_a_file_of_something_else_is_left_as_it_is(tmp_path):
    path = tmp_path / "notes.txt"
    for text in ("some notes\n", "notes without an end"):
        path.write_text(text)
        with pytest.raises(ResultError), row_file(path, ASKED):
            pass
        assert path.read_text() == text


def test_two_cannot_write_at_once(tmp_path):
    path = written(tmp_path / "rows.jsonl", 1)
    with (
        row_file(path, ASKED),
        pytest.raises(ResultError, match="another process is writing rows to it"),
        row_file(path, ASKED),
    ):
        pass
    with row_file(path, ASKED) as rows:
        assert rows.rows == (row(0),)


def test_a_folder_in_the_way_is_told(tmp_path):
    with pytest.raises(FileError, match="cannot be written"), row_file(tmp_path, ASKED):
        pass


def test_a_controller_is_named_by_its_numbers():
    assert named(ad.Pid(ad.PidGains(1, 2, (3, 4)))) == {
        "class": "Pid",
        "gains": {"class": "PidGains", "kp": 1.0, "ki": 2.0, "kd": [3.0, 4.0]},
        "form": "torque",
        "feedforward": True,
        "gravity": False,
    }
    with pytest.raises(ResultError, match="make it a dataclass, or give no file"):
        named(object())
