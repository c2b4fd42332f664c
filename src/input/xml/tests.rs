use std::fs;

use super::read_xml;
use crate::Error;

/// What `check` finds in a document without <skipped>.
fn with<T>(text: impl AsRef<[u8]>, check: impl Fn(crate::Result<super::Node>) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.xml");
    fs::write(&path, text).unwrap();
    match read_xml(&path, &["skipped"]) {
        Ok(document) => check(Ok(document.root())),
        Err(e) => check(Err(e)),
    }
}

fn message(text: impl AsRef<[u8]>) -> String {
    let e = with(text, |root| root.map(|_| ()).unwrap_err());
    assert_eq!(e.exit_code(), 2, "{e}");
    e.to_string()
}

#[test]
fn elements_attributes_and_text_are_read_with_their_lines() {
    let text = "\u{feff}<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- that -->\n<x:a  u:b='1 &lt; &#50;'>\n one &amp;\n<c/><skipped><c><d/>no</c></skipped>\n<d>2.5 <![CDATA[-1]]></d></x:a>\n";
    with(text, |root| {
        let root = root.unwrap();
        assert_eq!((root.name(), root.attribute("b")), ("a", Some("1 < 2")));
        assert_eq!(root.text(), "one &");
        let names: Vec<_> = root.children().map(super::Node::name).collect();
        assert_eq!(names, ["c", "d"]);
        let d = root.needed_child("d").unwrap();
        assert_eq!((d.numbers().unwrap(), d.place()), ([2.5, -1.0], "line 6".to_owned()));
        assert_eq!(root.find("d").unwrap().text(), "2.5 -1");
        let e = d.numbers::<3>().unwrap_err().to_string();
        assert!(e.contains("c.xml: line 6: expected 3 finite numbers in <d>, found fewer"), "{e}");
        assert!(d.number().unwrap_err().to_string().contains("\"-1\" beyond"));
        assert!(root.needed_child("e").unwrap_err().to_string().contains("<e>"));
    });
}

#[test]
fn what_is_not_well_formed_is_an_error_with_its_line() {
    for (text, line, what) in [
        ("<a>\n<b></a>", "line 2", "well-formed"),
        ("<a>\n<b>", "line 2", "end of <b>"),
        ("<a/>\n<b/>", "line 2", "<b> after its end"),
        ("<a x='1' x='2'/>", "line 1", "attributes of <a>"),
        ("<a x='&e;'/>", "line 1", "attributes of <a>"),
        ("<a>\n\n&e;</a>", "line 3", "&e;"),
        ("<a", "line 1", "well-formed"),
        ("", "line 1", "an element"),
        ("no", "line 1", "text outside"),
        ("<!DOCTYPE a [<!ENTITY e 'x'>]>\n<a>&e;</a>", "line 1", "DOCTYPE"),
    ] {
        let e = message(text);
        assert!(e.contains(&format!("c.xml: {line}: ")) && e.contains(what), "{text:?}: {e}");
    }
    assert!(message(b"<a>\xff\xfe</a>").contains("well-formed"));
}

#[test]
fn depth_and_length_have_limits() {
    let deep = "<a>".repeat(64) + &"</a>".repeat(64);
    assert!(with(&deep, |root| root.is_ok()));
    for name in ["a", "skipped"] {
        let deeper = format!("<a>{}", format!("<{name}>").repeat(64));
        let e = with(&deeper, |root| root.map(|_| ()).unwrap_err());
        assert!(matches!(e, Error::Limit { limit: 64, .. }), "{e}");
    }
    let long = format!("<a b='{}'/>", "x".repeat(5 << 20));
    let e = with(&long, |root| root.map(|_| ()).unwrap_err());
    assert!(matches!(&e, Error::Limit { what, .. } if what.contains("one tag")), "{e}");
}
