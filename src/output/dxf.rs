//! [`image_dxf`]: a drawing that shows the mosaic on its plane in space, as CAD programs read it.
//!
//! DXF of the year 2000 (`AC1015`), as text: lines in pairs, a group code and its value (Autodesk, "DXF Reference").
//! The picture is an `IMAGE` entity: insertion point = the ground point of the picture's lower-left corner, two vectors =
//! the steps of one pixel along u and v, metres, size in pixels. It names an `IMAGEDEF`, which names the file, without a
//! folder: the picture lies beside the drawing. An `IMAGEDEF_REACTOR` ties the two, and `ACAD_IMAGE_DICT` lists the
//! definition by the name under which the program shows it. All else is what a drawing of this version must have:
//! one of each table, the blocks of model and paper space with their layouts, the dictionaries. `$INSUNITS` is 6, metres,
//! and the view that opens looks at the plane from its viewer's side.
//!
//! The bytes are a function of the mosaic and its file's name. Handles are fixed numbers, hexadecimal: [`IMAGE`] and
//! those beside it, and the ones in the texts below.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;

use crate::frame::{Locator, Mosaic, Plane};
use crate::geom::Bounds3;
use crate::{Error, Result};

/// Handles of what is in the drawing.
const IMAGE: &str = "40";
const DEFINITION: &str = "41";
const REACTOR: &str = "42";
const IMAGE_DICTIONARY: &str = "30";
/// The first handle that a program may give to something new.
const FREE_HANDLE: &str = "50";

/// Application classes: name, class, proxy flags (what a program without the class may do), whether it is an entity.
const CLASSES: [(&str, &str, u32, u32); 4] = [
    ("IMAGE", "AcDbRasterImage", 127, 1),
    ("IMAGEDEF", "AcDbRasterImageDef", 0, 0),
    ("IMAGEDEF_REACTOR", "AcDbRasterImageDefReactor", 1, 0),
    ("RASTERVARIABLES", "AcDbRasterVariables", 0, 0),
];

/// A record of a table: handle, subclass, name and what follows it, a pair a line.
type Record = (&'static str, &'static str, &'static str, &'static str);
/// Tables: name, handle, records.
const TABLES: [(&str, &str, &[Record]); 8] = [
    (
        "LTYPE",
        "5",
        &[
            ("14", "AcDbLinetypeTableRecord", "ByBlock", LINE),
            ("15", "AcDbLinetypeTableRecord", "ByLayer", LINE),
            ("16", "AcDbLinetypeTableRecord", "Continuous", LINE),
        ],
    ),
    (
        "LAYER",
        "2",
        &[("10", "AcDbLayerTableRecord", "0", "70 0\n62 7\n6 Continuous\n370 -3\n390 F")],
    ),
    (
        "STYLE",
        "3",
        &[(
            "11",
            "AcDbTextStyleTableRecord",
            "Standard",
            "70 0\n40 0.0\n41 1.0\n50 0.0\n71 0\n42 2.5\n3 txt\n4 ",
        )],
    ),
    ("VIEW", "6", &[]),
    ("UCS", "7", &[]),
    ("APPID", "9", &[("12", "AcDbRegAppTableRecord", "ACAD", "70 0")]),
    ("DIMSTYLE", "A", &[("27", "AcDbDimStyleTableRecord", "Standard", "70 0")]),
    (
        "BLOCK_RECORD",
        "1",
        &[
            ("1F", "AcDbBlockTableRecord", "*Model_Space", "340 22"),
            ("1B", "AcDbBlockTableRecord", "*Paper_Space", "340 1E"),
        ],
    ),
];
const LINE: &str = "70 0\n3 \n72 65\n73 0\n40 0.0";

/// Blocks: name, handle of the record, of the beginning and of the end.
const BLOCKS: [(&str, &str, &str, &str); 2] =
    [("*Model_Space", "1F", "20", "21"), ("*Paper_Space", "1B", "1C", "1D")];

/// A dictionary: handle, owner, entries as name and handle.
type Dictionary = (&'static str, &'static str, &'static [(&'static str, &'static str)]);
const DICTIONARIES: [Dictionary; 6] = [
    (
        "C",
        "0",
        &[
            ("ACAD_GROUP", "D"),
            ("ACAD_IMAGE_DICT", IMAGE_DICTIONARY),
            ("ACAD_IMAGE_VARS", "31"),
            ("ACAD_LAYOUT", "1A"),
            ("ACAD_MLINESTYLE", "17"),
            ("ACAD_PLOTSETTINGS", "19"),
            ("ACAD_PLOTSTYLENAME", "E"),
        ],
    ),
    ("D", "C", &[]),
    ("1A", "C", &[("Model", "22"), ("Layout1", "1E")]),
    ("17", "C", &[("Standard", "18")]),
    ("19", "C", &[]),
    (IMAGE_DICTIONARY, "C", &[]),
];

/// The objects that are no dictionaries: the plot style of the layer, the style of double lines (which the header's
/// default names), and how pictures are shown: without a frame, at high quality, in metres.
const OBJECTS: &str = "\
0 ACDBDICTIONARYWDFLT\n5 E\n330 C\n100 AcDbDictionary\n281 1\n3 Normal\n350 F\n\
100 AcDbDictionaryWithDefault\n340 F\n0 ACDBPLACEHOLDER\n5 F\n330 E\n\
0 MLINESTYLE\n5 18\n330 17\n100 AcDbMlineStyle\n2 Standard\n70 0\n3 \n62 256\n51 90.0\n52 90.0\n71 2\n\
49 0.5\n62 256\n6 BYLAYER\n49 -0.5\n62 256\n6 BYLAYER\n\
0 RASTERVARIABLES\n5 31\n330 C\n100 AcDbRasterVariables\n90 0\n70 0\n71 1\n72 3\n";

/// Layouts: handle, name, block record, plot flags (1024: model space), order.
const LAYOUTS: [(&str, &str, &str, u32, u32); 2] =
    [("22", "Model", "1F", 1024, 0), ("1E", "Layout1", "1B", 0, 1)];
/// Of each: a sheet of A3, millimetres, nothing plotted on it yet.
const SHEET: &str = "\
1 \n2 none_device\n4 A3\n6 \n40 7.5\n41 20.0\n42 7.5\n43 20.0\n44 420.0\n45 297.0\n46 0.0\n47 0.0\n48 0.0\n49 0.0\n\
140 0.0\n141 0.0\n142 1.0\n143 1.0\n";
const SHEET_PLOT: &str = "72 1\n73 0\n74 5\n7 \n75 16\n147 1.0\n148 0.0\n149 0.0\n";
const SHEET_PLACE: &str = "\
10 0.0\n20 0.0\n11 420.0\n21 297.0\n12 0.0\n22 0.0\n32 0.0\n\
14 100000000000000000000.0\n24 100000000000000000000.0\n34 100000000000000000000.0\n\
15 -100000000000000000000.0\n25 -100000000000000000000.0\n35 -100000000000000000000.0\n\
146 0.0\n13 0.0\n23 0.0\n33 0.0\n16 1.0\n26 0.0\n36 0.0\n17 0.0\n27 1.0\n37 0.0\n76 0\n";

/// The drawing that shows the picture `file` (a name, or a path, of which the name is taken) where `mosaic` is drawn.
/// Coordinates are those of the ground, metres, the shortest decimals that read back to the same bits.
///
/// # Errors
/// [`Error::Usage`] if the mosaic is not drawn on a plane, or the name is not Unicode or has a control character.
pub fn image_dxf(mosaic: &Mosaic, file: &Path) -> Result<String> {
    let plane = mosaic.plane().ok_or_else(|| {
        Error::usage("a DXF shows a mosaic on a plane, not a development or a perspective view")
    })?;
    let picture = Picture::new(mosaic, plane, dxf_name(file)?)?;
    let mut groups = Groups::default();
    header(&mut groups, &picture);
    classes(&mut groups);
    tables(&mut groups, &picture);
    blocks(&mut groups);
    entities(&mut groups, &picture);
    objects(&mut groups, &picture);
    groups.add("0 EOF");
    Ok(groups.text)
}

/// The name of `file`, without a folder, if a drawing can hold it.
///
/// # Errors
/// [`Error::Usage`] if the name is not Unicode or has a control character.
pub fn dxf_name(file: &Path) -> Result<&str> {
    let name = file.file_name().and_then(OsStr::to_str);
    name.filter(|name| !name.chars().any(char::is_control)).ok_or_else(|| {
        let what = "expected a name in Unicode without control characters, for the DXF";
        Error::usage(format!("{}: {what}", file.display()))
    })
}

/// Where the picture stands and what it is called, as the drawing has it.
struct Picture {
    /// Lower-left corner, ground.
    corner: DVec3,
    /// Steps of a pixel along u and v, ground, metres.
    steps: [DVec3; 2],
    /// Towards the viewer.
    normal: DVec3,
    pixel_size: f64,
    width: f64,
    height: f64,
    /// Of its four corners, ground.
    bounds: Bounds3,
    /// The file's name, as a text of the drawing.
    file: String,
    /// The name that the program shows.
    name: String,
}

impl Picture {
    fn new(mosaic: &Mosaic, plane: &Plane, file: &str) -> Result<Self> {
        let [width, height] = [mosaic.size.width, mosaic.size.height].map(f64::from);
        let locator = Locator::new(mosaic);
        let corners = [[0.0, height], [width, height], [width, 0.0], [0.0, 0.0]];
        let corners = corners.map(|[column, row]| locator.ground(column, row, 0.0));
        let [Some(corner), Some(b), Some(c), Some(d)] = corners else {
            return Err(Error::usage("the mosaic's corners lie beyond all numbers"));
        };
        let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
        let allowed = |c: char| if "<>/\\\":;?*|,=`".contains(c) { '_' } else { c };
        Ok(Self {
            corner,
            steps: [plane.u, plane.v].map(|axis| axis * mosaic.pixel_size),
            normal: plane.n,
            pixel_size: mosaic.pixel_size,
            width,
            height,
            bounds: Bounds3::of([corner, b, c, d]),
            file: encoded(file),
            name: encoded(&stem.chars().map(allowed).collect::<String>()),
        })
    }
}

/// A text of a drawing: what is not ASCII as `\U+` and the four digits of each UTF-16 unit; a caret, which announces
/// control characters, with a blank behind it.
fn encoded(text: &str) -> String {
    let mut out = String::new();
    for unit in text.encode_utf16() {
        match char::from_u32(unit.into()).filter(char::is_ascii) {
            Some('^') => out.push_str("^ "),
            Some(c) => out.push(c),
            None => write!(out, "\\U+{unit:04X}").expect("a string takes every character"),
        }
    }
    out
}

/// A number with a point and without an exponent, the shortest that reads back to the same bits.
fn real(value: f64) -> String {
    let text = (value + 0.0).to_string();
    if text.contains('.') { text } else { text + ".0" }
}

/// The drawing's text.
#[derive(Default)]
struct Groups {
    text: String,
}

impl Groups {
    /// Adds pairs, `code value` a line here, each on two lines there.
    fn add(&mut self, pairs: &str) {
        for pair in pairs.lines() {
            let (code, value) = pair.split_once(' ').unwrap_or((pair, ""));
            writeln!(self.text, "{code:>3}\n{value}").expect("a string takes every character");
        }
    }

    /// Adds numbers, the first with the group code `code`, each further one with a code greater by ten.
    fn reals(&mut self, code: u32, values: &[f64]) {
        for (code, value) in (code..).step_by(10).zip(values) {
            self.add(&format!("{code} {}", real(*value)));
        }
    }

    fn point(&mut self, code: u32, point: DVec3) {
        self.reals(code, &point.to_array());
    }

    fn begin(&mut self, section: &str) {
        self.add(&format!("0 SECTION\n2 {section}"));
    }

    fn end(&mut self) {
        self.add("0 ENDSEC");
    }
}

fn header(groups: &mut Groups, picture: &Picture) {
    groups.begin("HEADER");
    groups.add("9 $ACADVER\n1 AC1015\n9 $DWGCODEPAGE\n3 ANSI_1252\n9 $EXTMIN");
    groups.point(10, picture.bounds.min);
    groups.add("9 $EXTMAX");
    groups.point(10, picture.bounds.max);
    groups.add(&format!("9 $HANDSEED\n5 {FREE_HANDLE}\n9 $MEASUREMENT\n70 1\n9 $INSUNITS\n70 6"));
    groups.end();
}

fn classes(groups: &mut Groups) {
    groups.begin("CLASSES");
    for (name, class, flags, is_entity) in CLASSES {
        groups.add(&format!(
            "0 CLASS\n1 {name}\n2 {class}\n3 ISM\n90 {flags}\n280 0\n281 {is_entity}"
        ));
    }
    groups.end();
}

fn tables(groups: &mut Groups, picture: &Picture) {
    groups.begin("TABLES");
    groups.add("0 TABLE\n2 VPORT\n5 8\n330 0\n100 AcDbSymbolTable\n70 1");
    viewport(groups, picture);
    groups.add("0 ENDTAB");
    for (table, handle, records) in TABLES {
        let count = records.len();
        groups.add(&format!(
            "0 TABLE\n2 {table}\n5 {handle}\n330 0\n100 AcDbSymbolTable\n70 {count}"
        ));
        // Of dimension styles alone the handle has a code of its own, and the table a second class.
        let is_dimension = table == "DIMSTYLE";
        if is_dimension {
            groups.add("100 AcDbDimStyleTable\n71 0");
        }
        let code = if is_dimension { 105 } else { 5 };
        for (own, class, name, rest) in records {
            groups.add(&format!("0 {table}\n{code} {own}\n330 {handle}"));
            groups.add(&format!("100 AcDbSymbolTableRecord\n100 {class}\n2 {name}\n{rest}"));
        }
        groups.add("0 ENDTAB");
    }
    groups.end();
}

/// The view that opens: towards the plane, the whole picture.
fn viewport(groups: &mut Groups, picture: &Picture) {
    let centre = 0.5 * (picture.bounds.min + picture.bounds.max);
    let height = 1.1 * picture.pixel_size * picture.width.hypot(picture.height);
    groups.add("0 VPORT\n5 26\n330 8\n100 AcDbSymbolTableRecord\n100 AcDbViewportTableRecord");
    groups.add("2 *Active\n70 0");
    // The window's corners and centre, then steps of snap and grid.
    for (code, at) in [(10, 0.0), (11, 1.0), (12, 0.0), (13, 0.0), (14, 1.0), (15, 1.0)] {
        groups.reals(code, &[at; 2]);
    }
    groups.point(16, picture.normal);
    groups.point(17, centre);
    groups.reals(40, &[height]);
    groups.add("41 1.5\n42 50.0\n43 0.0\n44 0.0\n50 0.0\n51 0.0\n71 0\n72 1000\n73 1\n74 3");
    groups.add("75 0\n76 0\n77 0\n78 0\n281 0\n65 0\n146 0.0");
}

fn blocks(groups: &mut Groups) {
    groups.begin("BLOCKS");
    for (name, record, begin, end) in BLOCKS {
        groups.add(&format!("0 BLOCK\n5 {begin}\n330 {record}\n100 AcDbEntity\n8 0"));
        groups.add(&format!("100 AcDbBlockBegin\n2 {name}\n70 0"));
        groups.point(10, DVec3::ZERO);
        groups.add(&format!("3 {name}\n1 "));
        groups.add(&format!("0 ENDBLK\n5 {end}\n330 {record}\n100 AcDbEntity\n8 0"));
        groups.add("100 AcDbBlockEnd");
    }
    groups.end();
}

/// The picture: shown (1), also where it does not face the screen (2), its transparent pixels transparent (8), clipped
/// to all of itself, whose pixels' centres are whole numbers here.
fn entities(groups: &mut Groups, picture: &Picture) {
    let size = [picture.width, picture.height];
    let [u, v] = picture.steps;
    groups.begin("ENTITIES");
    groups.add(&format!("0 IMAGE\n5 {IMAGE}\n330 1F\n100 AcDbEntity\n8 0"));
    groups.add("100 AcDbRasterImage\n90 0");
    groups.point(10, picture.corner);
    groups.point(11, u);
    groups.point(12, v);
    groups.reals(13, &size);
    groups.add(&format!("340 {DEFINITION}\n70 11\n280 0\n281 50\n282 50\n283 0\n360 {REACTOR}"));
    groups.add("71 1\n91 2");
    groups.reals(14, &[-0.5; 2]);
    groups.reals(14, &size.map(|side| side - 0.5));
    groups.end();
}

fn objects(groups: &mut Groups, picture: &Picture) {
    groups.begin("OBJECTS");
    for (handle, owner, entries) in DICTIONARIES {
        groups.add(&format!("0 DICTIONARY\n5 {handle}\n330 {owner}\n100 AcDbDictionary\n281 1"));
        for (name, entry) in entries {
            groups.add(&format!("3 {name}\n350 {entry}"));
        }
        if handle == IMAGE_DICTIONARY {
            groups.add(&format!("3 {}\n350 {DEFINITION}", picture.name));
        }
    }
    groups.add(OBJECTS);
    for (handle, name, record, flags, order) in LAYOUTS {
        groups
            .add(&format!("0 LAYOUT\n5 {handle}\n330 1A\n100 AcDbPlotSettings\n{SHEET}70 {flags}"));
        groups.add(SHEET_PLOT);
        groups
            .add(&format!("100 AcDbLayout\n1 {name}\n70 1\n71 {order}\n{SHEET_PLACE}330 {record}"));
    }
    definition(groups, picture);
    groups.end();
}

/// The definition (loaded, its pixels of no stated unit) and the reactor that ties the picture to it.
fn definition(groups: &mut Groups, picture: &Picture) {
    groups.add(&format!("0 IMAGEDEF\n5 {DEFINITION}\n102 {{ACAD_REACTORS\n330 {IMAGE_DICTIONARY}"));
    groups.add(&format!(
        "330 {REACTOR}\n102 }}\n330 {IMAGE_DICTIONARY}\n100 AcDbRasterImageDef\n90 0"
    ));
    groups.add(&format!("1 {}", picture.file));
    groups.reals(10, &[picture.width, picture.height]);
    groups.reals(11, &[picture.pixel_size; 2]);
    groups.add("280 1\n281 0");
    groups.add(&format!("0 IMAGEDEF_REACTOR\n5 {REACTOR}\n330 {IMAGE}"));
    groups.add(&format!("100 AcDbRasterImageDefReactor\n90 2\n330 {IMAGE}"));
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn mosaic() -> Mosaic {
        let plane = Plane::new([500_000.5, 0.25, -1e-7], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]).unwrap();
        let slab = [f64::NEG_INFINITY, f64::INFINITY];
        Mosaic::new(plane, 0.5, [-1.0, 2.0, 1.2, 5.0], slab).unwrap()
    }

    fn pairs(text: &str) -> Vec<(u32, &str)> {
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len() % 2, 0);
        lines.as_chunks::<2>().0.iter().map(|[c, v]| (c.trim().parse().unwrap(), *v)).collect()
    }

    #[test]
    fn the_picture_stands_on_its_lower_left_corner() {
        let text = image_dxf(&mosaic(), Path::new("folder/m.tif")).unwrap();
        let pairs = pairs(&text);
        let at = pairs.iter().position(|pair| *pair == (0, "IMAGE")).unwrap();
        let number = |code: u32| {
            let found = pairs[at..].iter().find(|(c, _)| *c == code).unwrap().1;
            assert!(!found.contains('e'), "{found}");
            found.parse::<f64>().unwrap()
        };
        let point = |code| DVec3::new(number(code), number(code + 10), number(code + 20));
        // u = −1 and v = 2: five columns reach beyond u = 1.2, six rows end at v = 2.
        let due = DVec3::new(500_000.5 - 0.6, 0.25 - 0.8, 2.0 - 1e-7);
        assert!((point(10) - due).length() < 1e-9, "{}", point(10));
        assert!((point(11) - DVec3::new(0.3, 0.4, 0.0)).length() < 1e-15);
        assert!((point(12) - DVec3::new(0.0, 0.0, 0.5)).length() < 1e-15);
        assert_eq!(
            (number(13).to_bits(), number(23).to_bits()),
            (5_f64.to_bits(), 6_f64.to_bits())
        );
        assert!(pairs.contains(&(1, "m.tif")) && pairs.contains(&(3, "m")));
    }

    #[test]
    fn every_handle_is_there_once_and_below_the_free_one() {
        let text = image_dxf(&mosaic(), Path::new("m.tif")).unwrap();
        let start = text.find("TABLES").unwrap();
        let all = pairs(&text[..start - 5]).len();
        let pairs = &pairs(&text)[all..];
        let mut handles = BTreeSet::from(["0"]);
        for (_, handle) in pairs.iter().filter(|(code, _)| matches!(code, 5 | 105)) {
            assert!(handles.insert(*handle), "{handle} twice");
            let number = |hex| u32::from_str_radix(hex, 16).unwrap();
            assert!(number(*handle) < number(FREE_HANDLE), "{handle}");
        }
        for (code, handle) in pairs.iter().filter(|(c, _)| matches!(c, 330 | 340 | 350 | 360 | 390))
        {
            assert!(handles.contains(handle), "{code} {handle} is not there");
        }
    }

    #[test]
    fn names_are_ascii_and_keep_what_they_are() {
        let text = image_dxf(&mosaic(), Path::new("Ä^;1 \u{1f3db}.tif")).unwrap();
        assert!(text.is_ascii());
        let pairs = pairs(&text);
        assert!(pairs.contains(&(1, "\\U+00C4^ ;1 \\U+D83C\\U+DFDB.tif")), "{text}");
        assert!(pairs.contains(&(3, "\\U+00C4^ _1 \\U+D83C\\U+DFDB")), "{text}");
        let error = image_dxf(&mosaic(), Path::new("a\nb.tif")).unwrap_err();
        assert!(error.to_string().contains("control"), "{error}");
    }
}
