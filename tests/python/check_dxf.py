"""Tells what ezdxf finds in drawings.

Standard input: [path]; standard output: for each {"version", "units", "faults": [text] (what the audit finds or mends),
"file", "key" (the definition's name), "size": [columns, rows] of the picture, "defined": those of its definition, "insert",
"u", "v": points, "tied": whether picture, definition, reactor and dictionary name each other, "view": [direction, target],
"extents": [min, max]}.
"""

import json
import sys

import ezdxf
from ezdxf.lldxf.encoding import decode_dxf_unicode

answers = []
for path in json.load(sys.stdin):
    document = ezdxf.readfile(path)
    audit = document.audit()
    (image,) = document.modelspace()
    definition = image.image_def
    reactor = document.entitydb[image.dxf.image_def_reactor_handle]
    images = document.rootdict["ACAD_IMAGE_DICT"]
    ((key, listed),) = list(images.items())
    (view,) = document.viewports.get("*Active")
    answers.append(
        {
            "version": document.dxfversion,
            "units": document.units,
            "faults": [entry.message for entry in audit.errors + audit.fixes],
            "file": decode_dxf_unicode(definition.dxf.filename),
            "key": decode_dxf_unicode(key),
            "size": list(image.dxf.image_size)[:2],
            "defined": list(definition.dxf.image_size)[:2],
            "insert": list(image.dxf.insert),
            "u": list(image.dxf.u_pixel),
            "v": list(image.dxf.v_pixel),
            "tied": image.dxftype() == "IMAGE"
            and listed is definition
            and reactor.dxf.image_handle == image.dxf.handle
            and reactor.dxf.handle in definition.get_reactors()
            and images.dxf.handle in definition.get_reactors()
            and definition.dxf.owner == images.dxf.handle,
            "view": [list(view.dxf.direction), list(view.dxf.target)],
            "extents": [list(document.header["$EXTMIN"]), list(document.header["$EXTMAX"])],
        }
    )
print(json.dumps(answers))
