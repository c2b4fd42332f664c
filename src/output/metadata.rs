//! The `GDAL_METADATA` tag (42112): a layer's items, band descriptions and units as XML.
//!
//! GDAL escapes an item's text twice when it writes and unescapes it twice when it reads, so a text is escaped twice
//! here too; names are escaped once, there as here.

use std::fmt::Write as _;

use super::{Layer, Meaning};

/// The XML of a layer; the same for the same layer.
pub(super) fn gdal_metadata(layer: &Layer) -> String {
    let mut xml = String::from("<GDALMetadata>\n");
    for (name, value) in layer.items() {
        item(&mut xml, name, "", value);
    }
    for (band, description) in band_descriptions(layer).into_iter().enumerate() {
        let role = format!(" sample=\"{band}\" role=\"description\"");
        item(&mut xml, "DESCRIPTION", &role, description);
    }
    if layer.meaning() == Meaning::Elevation {
        item(&mut xml, "UNITTYPE", " sample=\"0\" role=\"unittype\"", "m");
    }
    xml.push_str("</GDALMetadata>\n");
    xml
}

fn band_descriptions(layer: &Layer) -> Vec<&'static str> {
    match (layer.meaning(), layer.channels()) {
        (Meaning::Mosaic, 2) => vec!["grey", "alpha"],
        (Meaning::Mosaic, _) => vec!["red", "green", "blue", "alpha"],
        (meaning, _) => vec![meaning.name()],
    }
}

fn item(xml: &mut String, name: &str, attributes: &str, value: &str) {
    let (name, value) = (escaped(name), escaped(&escaped(value)));
    writeln!(xml, "  <Item name=\"{name}\"{attributes}>{value}</Item>")
        .expect("a string takes every character");
}

/// `text` as XML character data; characters that XML 1.0 cannot hold become U+FFFD.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(c),
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_item_can_break_out_of_the_xml() {
        let layer = Layer::of(Meaning::Count).unwrap().with_item("a\"b", "</Item>&\u{0}");
        let xml = gdal_metadata(&layer);
        assert!(
            xml.contains("<Item name=\"a&quot;b\">&amp;lt;/Item&amp;gt;&amp;amp;\u{fffd}</Item>"),
            "{xml}"
        );
    }
}
