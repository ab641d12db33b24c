"""Elements of SVG are read by an XML parser as they were meant."""

import math
from xml.etree import ElementTree as ET

from kincompile.report.svg import element, label, outline


def pair(point):
    x, y = point
    return f"{x:g} {y:g}"


def test_that_attributes_are_read_back_and_empty_ones_are_left_out():
    found = ET.fromstring(element("path", class_="s-ink", stroke_width=1.5, fill=""))
    assert found.attrib == {"class": "s-ink", "stroke-width": "1.5"}
    found = ET.fromstring(element("g", element("a"), font_family='"Math"', dy=0))
    assert found.attrib == {"font-family": '"Math"', "dy": "0"}
    assert [child.tag for child in found] == ["a"]


def test_that_a_label_is_its_text_whatever_is_in_it():
    assert ET.fromstring(label('A<B> & "C"', x=1)).text == 'A<B> & "C"'


def test_that_an_outline_is_interrupted_where_a_point_is_missing():
    points = [(0, 0), (1, 0), (math.nan, 0), (2, 1), (3, 1)]
    assert outline(points, False, pair) == "M0 0L1 0M2 1L3 1"
    assert outline(points[:2], True, pair) == "M0 0L1 0Z"
