"""URDFs made wrong: one seed, one way of being wrong."""

import random
from collections.abc import Callable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

NUMBERS = [
    "nan", "inf", "-inf", "-1", "0", "-0.0", "1e400", "-1e400", "1e308", "-1e308", "1e200", "1e-320", "1e-12", "3.5e7",
    "abc", "1,5", "0x10", "1_000", "١", "1e", "1..2", "+-1", "--1", "1e+", "∞", "NaN()", "1f",
    "", " ", "1 2", "9" * 5000, "0." + "0" * 5000 + "1", "1\n", "${mass}", "$(find x)",
]  # fmt: skip
NAMES = ["", " ", "universe", "root_joint", "tip", "base", "../..", "a\tb", "Ω" * 50, "x" * 100_000, "%s%n", "'\"<>&"]
KINDS = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical", "", "REVOLUTE", "mimic"]
MESHES = ["package://../../../etc/passwd", "file:///etc/passwd", "/dev/zero", "package://nowhere/a.stl", "\\\\x\\y.stl"]
BOMB = '<!DOCTYPE r [<!ENTITY a "ha">{}]>\n'.format(
    "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">'.replace("a0;", "a;") for i in range(1, 12))
)


def mutated(text: str, seed: int | random.Random) -> bytes:
    """A URDF with one to four things wrong with it, or now and then none."""
    rng = random.Random(seed) if isinstance(seed, int) else seed
    root = ElementTree.fromstring(text)
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3, 4))):
        rng.choice(TREE)(root, rng)
    data = ElementTree.tostring(root, encoding="utf-8")
    if rng.random() < 0.2:
        data = rng.choice(BYTES)(data, rng)
    return data


def _any(root: Element, rng: random.Random, *tags: str) -> Element:
    return rng.choice([e for e in root.iter() if not tags or e.tag in tags] or [root])


def _value(root: Element, rng: random.Random, values: list[str], *tags: str) -> None:
    element = _any(root, rng, *tags)
    if element.attrib:
        key = rng.choice(sorted(element.attrib))
        words = element.attrib[key].split() or [""]
        words[rng.randrange(len(words))] = rng.choice(values)
        element.set(key, " ".join(words))


def number(root: Element, rng: random.Random) -> None:
    _value(root, rng, NUMBERS, "mass", "inertia", "origin", "axis", "limit", "dynamics", "mimic")


def scale(root: Element, rng: random.Random) -> None:
    element = _any(root, rng, "mass", "inertia", "origin", "limit")
    factor = 10.0 ** rng.uniform(-300, 300)
    for key, value in element.attrib.items():
        try:
            element.set(key, " ".join(repr(float(word) * factor) for word in value.split()))
        except ValueError:
            return


def name(root: Element, rng: random.Random) -> None:
    others = [str(e.get("name") or e.get("link")) for e in root.iter() if e.get("name") or e.get("link")]
    element = _any(root, rng, "link", "joint", "parent", "child", "mimic")
    for key in ("link", "joint", "name"):
        if key in element.attrib:
            element.set(key, rng.choice(NAMES + others))
            return


def kind(root: Element, rng: random.Random) -> None:
    _any(root, rng, "joint").set("type", rng.choice(KINDS))


def remove(root: Element, rng: random.Random) -> None:
    parent = _any(root, rng)
    if len(parent):
        parent.remove(rng.choice(list(parent)))


def duplicate(root: Element, rng: random.Random) -> None:
    parent = _any(root, rng)
    if len(parent):
        parent.append(rng.choice(list(parent)))


def forget(root: Element, rng: random.Random) -> None:
    element = _any(root, rng)
    if element.attrib:
        del element.attrib[rng.choice(sorted(element.attrib))]


def misspell(root: Element, rng: random.Random) -> None:
    element = _any(root, rng)
    element.tag = rng.choice(["robot", "link", "joint", "inertial", "limit", "xacro", "x"])


def weightless(root: Element, rng: random.Random) -> None:
    for inertial in root.iter("inertial"):
        if rng.random() < 0.5:
            for element in inertial:
                if element.tag in ("mass", "inertia"):
                    element.attrib.update(dict.fromkeys(element.attrib, "0"))


def rewire(root: Element, rng: random.Random) -> None:
    links = [str(link.get("name")) for link in root.findall("link")]
    _any(root, rng, "parent", "child").set("link", rng.choice(links or ["none"]))


def mimic(root: Element, rng: random.Random) -> None:
    joints = [str(joint.get("name")) for joint in root.findall("joint")]
    leader = rng.choice([*joints, "nobody"])
    SubElement(_any(root, rng, "joint"), "mimic", joint=leader, multiplier=rng.choice(["1", "-2", *NUMBERS]))


def chain(root: Element, rng: random.Random) -> None:
    """A tree of many links, one behind the other or all on one."""
    links = [str(link.get("name")) for link in root.findall("link")] or ["base"]
    before, deep = rng.choice(links), rng.random() < 0.5
    for i in range(rng.choice((3, 300, 1100, 5000))):
        link = f"c{rng.random()}_{i}"
        inertial = SubElement(SubElement(root, "link", name=link), "inertial")
        SubElement(inertial, "mass", value="0.1")
        SubElement(inertial, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
        joint = SubElement(root, "joint", name=f"j{link}", type=rng.choice(["revolute", "fixed", "fixed"]))
        SubElement(joint, "parent", link=before)
        SubElement(joint, "child", link=link)
        SubElement(joint, "limit", lower="-1", upper="1", effort="1", velocity="1")
        before = link if deep else before


def many(root: Element, rng: random.Random) -> None:
    for _ in range(rng.choice((100, 20_000))):
        SubElement(root, rng.choice(["gazebo", "material", "transmission"]), name="n")


def nest(root: Element, rng: random.Random) -> None:
    inner = _any(root, rng)
    for _ in range(rng.choice((10, 60, 400))):
        inner = SubElement(inner, "a")


def mesh(root: Element, rng: random.Random) -> None:
    geometry = SubElement(SubElement(_any(root, rng, "link"), rng.choice(["visual", "collision"])), "geometry")
    SubElement(geometry, "mesh", filename=rng.choice(MESHES), scale=rng.choice(["1 1 1", *NUMBERS]))


TREE: tuple[Callable[[Element, random.Random], None], ...] = (
    number, number, number, scale, scale, name, name, kind, remove, duplicate, forget, misspell, weightless,
    rewire, rewire, mimic, mesh, chain, many, nest,
)  # fmt: skip


def flip(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 3, 30))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def repeat(data: bytes, rng: random.Random) -> bytes:
    a = rng.randrange(len(data))
    b = min(len(data), a + rng.choice((10, 1000)))
    return data[:b] + data[a:b] * rng.choice((1, 50)) + data[b:]


def shuffle(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"<")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"<".join(lines)


def recode(data: bytes, rng: random.Random) -> bytes:
    return data.decode(errors="replace").encode(rng.choice(["utf-16", "utf-32", "cp037"]), errors="replace")


def zeros(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes(rng.choice((1, 10_000_000))) + data[at:]


def bomb(data: bytes, rng: random.Random) -> bytes:
    return BOMB.encode() + data.replace(b'value="', b'value="&a11;', 1)


BYTES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    flip, flip, flip, cut, repeat, shuffle, recode, zeros, bomb,
)  # fmt: skip
