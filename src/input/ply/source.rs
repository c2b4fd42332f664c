//! A PLY file as a mesh.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::super::byte_reader::ByteReader;
use super::ascii::{AsciiFaces, AsciiVertices, Lines};
use super::binary::{BinaryFaces, BinaryVertices};
use super::header::{Element, Encoding, Header, Kind, Property};
use super::records::Records;
use super::scalar::Scalar;
use crate::geom::{Bounds3, FaceStream, MeshSource, VertexStream, f32_spacing};
use crate::{Error, Result};

/// A PLY file whose header has been read and checked: a mesh of vertices and faces.
///
/// Accepted: text and binary of either byte order; coordinates of any number type; any further elements and
/// properties, which are passed over; lists of vertices named `vertex_indices` or `vertex_index`.
#[derive(Debug)]
pub struct PlyMesh {
    path: PathBuf,
    header: Header,
    /// Places of the elements `vertex` and `face` in the header.
    vertex: usize,
    face: usize,
    /// Place among the face's properties, and type, of the list of vertices.
    indices: (usize, Scalar),
    /// Where each element starts, once known.
    starts: Vec<OnceLock<u64>>,
}

impl PlyMesh {
    /// Opens a PLY file and checks its header.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] if it is no PLY file, or lacks vertices, x, y, z,
    /// faces or their lists of vertices, or promises more than it holds; [`Error::Unsupported`] for triangle
    /// strips; [`Error::Limit`] for more vertices or faces than 32 bits can number.
    pub fn open(path: &Path) -> Result<Self> {
        let mut reader = ByteReader::open(path, 0)?;
        let most_bytes = reader.most_bytes();
        let header = Header::read(&mut reader, most_bytes)?;
        let vertex = find_vertices(path, &header)?;
        let (face, indices) = find_faces(path, &header)?;
        for (element, what) in [(vertex, "vertices"), (face, "faces")] {
            let (found, limit) = (header.elements[element].count, u64::from(u32::MAX));
            if found > limit {
                let what = format!("number of {what} in {}", path.display());
                return Err(Error::Limit { what, limit, found });
            }
        }
        let starts: Vec<_> = header.elements.iter().map(|_| OnceLock::new()).collect();
        let path = path.to_path_buf();
        Ok(Self { path, header, vertex, face, indices, starts })
    }

    /// Where an element starts; elements before it that hold lists, or stand in text, are gone past once.
    fn start_of(&self, element: usize) -> Result<u64> {
        let Some(before) = element.checked_sub(1) else { return Ok(self.header.bytes) };
        if let Some(start) = self.starts[element].get() {
            return Ok(*start);
        }
        let reader = ByteReader::open(&self.path, self.start_of(before)?)?;
        let passed = &self.header.elements[before];
        let start = match self.header.encoding {
            Encoding::Ascii => Lines::new(reader, passed).skip_all()?,
            Encoding::Binary(order) => Records::new(reader, passed, order).skip_all()?,
        };
        Ok(*self.starts[element].get_or_init(|| start))
    }

    fn open_at(&self, element: usize) -> Result<(ByteReader<'_>, &Element)> {
        let reader = ByteReader::open(&self.path, self.start_of(element)?)?;
        Ok((reader, &self.header.elements[element]))
    }
}

impl MeshSource for PlyMesh {
    fn path(&self) -> &Path {
        &self.path
    }

    fn vertex_count(&self) -> u64 {
        self.header.elements[self.vertex].count
    }

    fn face_count(&self) -> u64 {
        self.header.elements[self.face].count
    }

    fn spacing_m(&self, bounds: &Bounds3) -> f64 {
        let is_binary = matches!(self.header.encoding, Encoding::Binary(_));
        let is_single = |p: &Property| p.kind == Kind::Scalar(Scalar::F32);
        let axes = ["x", "y", "z"].map(|axis| self.header.elements[self.vertex].property(axis));
        let any_single = axes.iter().flatten().any(|(_, p)| is_single(p));
        if is_binary && any_single { f32_spacing(bounds) } else { 0.0 }
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        let (reader, element) = self.open_at(self.vertex)?;
        Ok(match self.header.encoding {
            Encoding::Ascii => Box::new(AsciiVertices::new(Lines::new(reader, element))),
            Encoding::Binary(order) => {
                Box::new(BinaryVertices::new(Records::new(reader, element, order)))
            }
        })
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        let (reader, element) = self.open_at(self.face)?;
        let ((indices, item), vertices) = (self.indices, self.vertex_count());
        Ok(match self.header.encoding {
            Encoding::Ascii => {
                Box::new(AsciiFaces::new(Lines::new(reader, element), indices, vertices))
            }
            Encoding::Binary(order) => {
                let records = Records::new(reader, element, order);
                Box::new(BinaryFaces::new(records, indices, item, vertices))
            }
        })
    }
}

/// The place of the element `vertex`, which has scalars x, y and z.
fn find_vertices(path: &Path, header: &Header) -> Result<usize> {
    let Some((place, element)) = header.element("vertex") else {
        return Err(Error::corrupt(path, "header", "an element `vertex`", "none"));
    };
    for axis in ["x", "y", "z"] {
        match element.property(axis).map(|(_, p)| p.kind) {
            Some(Kind::Scalar(_)) => {}
            Some(Kind::List { .. }) => {
                let place = format!("header, property `{axis}` of `vertex`");
                return Err(Error::corrupt(path, place, "a number", "a list"));
            }
            None => {
                let expected = format!("a property `{axis}`");
                return Err(Error::corrupt(path, "header, element `vertex`", expected, "none"));
            }
        }
    }
    Ok(place)
}

/// The place of the element `face`; place and type of its list of vertices.
fn find_faces(path: &Path, header: &Header) -> Result<(usize, (usize, Scalar))> {
    let Some((place, element)) = header.element("face") else {
        if header.element("tristrips").is_some() {
            let hint = Some("export the mesh with an element `face`".to_owned());
            let what = "a mesh of triangle strips".to_owned();
            return Err(Error::Unsupported { path: path.to_path_buf(), what, hint });
        }
        return Err(Error::corrupt(path, "header", "an element `face`", "none: a point cloud"));
    };
    let named = |name| element.property(name);
    let list = named("vertex_indices").or_else(|| named("vertex_index"));
    match list.map(|(place, p)| (place, p.kind)) {
        Some((list, Kind::List { item, .. })) => Ok((place, (list, item))),
        found => {
            let found = if found.is_some() { "a number" } else { "none" };
            let expected = "a list `vertex_indices` or `vertex_index`";
            Err(Error::corrupt(path, "header, element `face`", expected, found))
        }
    }
}
