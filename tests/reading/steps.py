"""STEP files that tests write by hand, as ISO 10303-21 and its schema for mechanical design have them."""

from __future__ import annotations

from typing import Any

import numpy as np

_HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('box','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""


class _Rows:
    """The rows of a file. Each has a number, by which others name it."""

    def __init__(self) -> None:
        self.rows = list[str]()

    def row(self, text: str) -> str:
        """Add a row as it is, and return its name."""
        self.rows.append(f"#{len(self.rows) + 1}={text};")
        return f"#{len(self.rows)}"

    def add(self, kind: str, *values: str, name: str = "") -> str:
        """Add a row of a kind, with a name and values, and return its name."""
        return self.row(f"{kind}({','.join((_text(name), *values))})")

    def triple(self, kind: str, values: Any) -> str:
        return self.add(kind, _listed(f"{float(value):.6f}" for value in values))


def _text(words: str) -> str:
    return f"'{words}'"


def _listed(values: Any) -> str:
    return f"({','.join(values)})"


def box(size: tuple[float, float, float]) -> str:
    """A box in millimetres with a corner at the origin: 6 planes, 12 edges, 8 vertices."""
    rows = _Rows()
    places = [np.array([x, y, z]) * size for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    corners = [rows.add("VERTEX_POINT", rows.triple("CARTESIAN_POINT", place)) for place in places]
    edges: dict[tuple[int, int], str] = {}

    def edge(a: int, b: int) -> str:
        if (b, a) in edges:
            return rows.add("ORIENTED_EDGE", "*", "*", edges[b, a], ".F.")
        way = places[b] - places[a]
        length = float(np.linalg.norm(way))
        vector = rows.add("VECTOR", rows.triple("DIRECTION", way / length), f"{length:.6f}")
        line = rows.add("LINE", rows.triple("CARTESIAN_POINT", places[a]), vector)
        edges[a, b] = rows.add("EDGE_CURVE", corners[a], corners[b], line, ".T.")
        return rows.add("ORIENTED_EDGE", "*", "*", edges[a, b], ".T.")

    faces = list[str]()
    for loop in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
        sides = _listed([edge(a, b) for a, b in zip(loop, (*loop[1:], loop[0]), strict=True)])
        bound = rows.add("FACE_OUTER_BOUND", rows.add("EDGE_LOOP", sides), ".T.")
        along, across = places[loop[1]] - places[loop[0]], places[loop[2]] - places[loop[1]]
        normal = np.cross(along, across)
        directions = [rows.triple("DIRECTION", each / np.linalg.norm(each)) for each in (normal, along)]
        frame = rows.add("AXIS2_PLACEMENT_3D", rows.triple("CARTESIAN_POINT", places[loop[0]]), *directions)
        faces.append(rows.add("ADVANCED_FACE", f"({bound})", rows.add("PLANE", frame), ".T."))
    solid = rows.add("MANIFOLD_SOLID_BREP", rows.add("CLOSED_SHELL", _listed(faces)), name="box")
    shape = rows.add("ADVANCED_BREP_SHAPE_REPRESENTATION", f"({solid})", _units(rows))
    _product(rows, shape)
    return _HEAD + "\n".join(rows.rows) + "\nENDSEC;\nEND-ISO-10303-21;\n"


def _units(rows: _Rows) -> str:
    """Add a context of millimetres, and return its name."""
    millimetre = rows.row("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    radian = rows.row("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    steradian = rows.row("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    close = rows.row(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),{millimetre},'','')")
    return rows.row(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({close}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({millimetre},{radian},{steradian}))REPRESENTATION_CONTEXT('',''))"
    )


def _product(rows: _Rows, shape: str) -> None:
    """Add the product that has this shape. Readers begin with it."""
    application = rows.add("APPLICATION_CONTEXT", name="core data for automotive mechanical design processes")
    context = rows.add("PRODUCT_CONTEXT", application, _text("mechanical"))
    product = rows.add("PRODUCT", _text("box"), _text(""), f"({context})", name="box")
    formation = rows.add("PRODUCT_DEFINITION_FORMATION", _text(""), product)
    view = rows.add("PRODUCT_DEFINITION_CONTEXT", application, _text("design"), name="part definition")
    definition = rows.add("PRODUCT_DEFINITION", _text(""), formation, view, name="design")
    found = rows.add("PRODUCT_DEFINITION_SHAPE", _text(""), definition)
    rows.row(f"SHAPE_DEFINITION_REPRESENTATION({found},{shape})")
