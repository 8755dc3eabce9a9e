"""A URDF robot to begin with, and a grammar of links and joints."""

from __future__ import annotations

import random

from fuzzing.mutations import NUMBERS, TEXTS

URDF = b"""<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="l1"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2.5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/></inertial></link>
  <link name="l2"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/></inertial></link>
  <link name="tool"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/>
    <origin xyz="0 0 0.3" rpy="1.57 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="100"/>
    <dynamics damping="0.5" friction="1"/></joint>
  <joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" velocity="1" effort="10"/></joint>
  <joint name="j3" type="fixed"><parent link="l2"/><child link="tool"/></joint>
</robot>
"""

URDF_CHUNKS = (
    "<!DOCTYPE r>", '<!DOCTYPE r [<!ENTITY a "b">]>', '<!DOCTYPE r SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE r [<!ENTITY % x SYSTEM "http://localhost:9/x"> %x;]>', "&a;", "&#0;", "&#x1b;",
    "<![CDATA[", "]]>", "<!--", "-->", "<?php ?>", '<?xml version="1.0" encoding="utf-16"?>',
    '<?xml version="1.1"?>', '<?xml version="1.0" encoding="utf-7"?>', "<a>" * 2000, "</robot>",
    '<link name="l1"/>',
    '<joint name="x" type="floating"><parent link="l1"/><child link="l3"/></joint>',
    'xmlns="urn:x"', '<mimic joint="j1"/>', "<inertial/>", '<origin xyz="nan 0 0"/>', "&lt;",
    '<xi:include href="/etc/passwd" xmlns:xi="http://www.w3.org/2001/XInclude"/>', "\x85", "\u2028",
)  # fmt: skip


def grown_urdf(rng: random.Random) -> bytes:
    """A tree, or nearly one, of links and joints."""
    names = [
        rng.choice(("l", "é", "<", "a" * 50, "[", "=")) + str(k) for k in range(rng.randrange(1, 8))
    ]
    parts = [f'<link name="{_xml(name)}">{_inertial(rng)}</link>' for name in names]
    for k, child in enumerate(names[1:], start=1):
        parent = rng.choice(names[:k] if rng.random() < 0.9 else names)
        kind = rng.choice(
            ("revolute", "continuous", "prismatic", "fixed", "planar", "floating", "")
        )
        inner = f'<parent link="{_xml(parent)}"/><child link="{_xml(child)}"/>'
        if rng.random() < 0.5:
            inner += (
                f'<axis xyz="{_triple(rng)}"/><origin xyz="{_triple(rng)}" rpy="{_triple(rng)}"/>'
            )
        if rng.random() < 0.5:
            inner += (
                f'<limit lower="{_value(rng)}" upper="{_value(rng)}" velocity="{_value(rng)}"/>'
            )
        if rng.random() < 0.3:
            inner += f'<dynamics damping="{_value(rng)}" friction="{_value(rng)}"/>'
        if rng.random() < 0.1:
            inner += f'<mimic joint="j{rng.randrange(9)}"/>'
        parts.append(f'<joint name="j{k}" type="{kind}">{inner}</joint>')
    rng.shuffle(parts)
    return f'<robot name="{_xml(rng.choice(TEXTS))}">{"".join(parts)}</robot>'.encode()


def _inertial(rng: random.Random) -> str:
    if rng.random() < 0.4:
        return ""
    moments = "".join(f' i{ax}="{_value(rng)}"' for ax in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return f'<inertial><mass value="{_value(rng)}"/><inertia{moments}/></inertial>'


def _value(rng: random.Random) -> str:
    return rng.choice(NUMBERS) if rng.random() < 0.2 else f"{rng.gauss(0, 2):.3g}".lstrip("-")


def _triple(rng: random.Random) -> str:
    return " ".join(_value(rng) for _ in range(3))


def _xml(text: str) -> str:
    from xml.sax.saxutils import quoteattr

    return quoteattr(text.replace("\x7f", "")).strip("\"'")
