"""3MF files written part by part."""

import zipfile

TYPES = (
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
    'Target="/3D/part.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)
CORNERS = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
SIDES = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
SOLID = f"<mesh><vertices>{CORNERS}</vertices><triangles>{SIDES}</triangles></mesh>"
BEAMS = '<b:beamlattice minlength="0.1" radius="1"><b:beams><b:beam v1="0" v2="3"/></b:beams></b:beamlattice>'
TIP = f'<object id="1" type="model" name="tip">{SOLID}</object>'


def write_3mf(path, objects=TIP, build='<item objectid="1"/>', unit="millimeter", method=zipfile.ZIP_DEFLATED):
    model = (
        f'<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
        f'xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02">'
        f"<resources>{objects}</resources><build>{build}</build></model>"
    )
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS), ("3D/part.model", model)):
            archive.writestr(name, '<?xml version="1.0" encoding="UTF-8"?>' + text)
    return path


def doubled(levels):
    """Objects of which each is twice the one before: a kilobyte names 2**levels bodies."""
    return TIP + "".join(
        f'<object id="{k}" type="model"><components><component objectid="{k - 1}"/><component objectid="{k - 1}"/>'
        "</components></object>"
        for k in range(2, levels + 2)
    )
