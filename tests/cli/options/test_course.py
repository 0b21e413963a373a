"""Shapes and files of --obstacle."""

from armdyn.cli.options.path_constraints import obstacles_of


def test_a_file_may_have_an_at_sign_in_its_name(tmp_path):
    file = tmp_path / "cell@2.json"
    file.write_text('[{"type": "sphere", "center": [0.1, 0, 0.3], "radius": 0.04}]')
    (ball,) = obstacles_of([str(file)])
    assert ball.radius == 0.04
