//! The mesh as it will stream: blocks of vertices, and parts that name them.
//!
//! In: the document and its buffers. Out: a list of blocks and parts, every offset and length of which has been compared
//! with its view and its buffer.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DAffine3;

use super::buffers::{BufferBytes, Container};
use super::document::{Accessor, Document, Primitive};
use super::nodes::{Placed, placed_meshes};
use crate::geom::{Bounds3, f32_spacing};
use crate::{Error, Result};

/// Most primitives in a scene, each counted for every node that uses it.
const PART_LIMIT: usize = 1 << 16;
/// Component types of accessors.
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;
/// What may be required without touching the geometry.
const HARMLESS: [&str; 5] =
    ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "MSFT_texture_"];

/// Elements in a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Elements {
    pub(super) buffer: usize,
    /// Where the first is in the buffer.
    pub(super) offset: u64,
    pub(super) count: u32,
    /// Bytes of one, and from one to the next.
    pub(super) size: usize,
    pub(super) stride: usize,
}

/// Vertices that stand together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub(super) positions: Elements,
    pub(super) scene_from_mesh: DAffine3,
}

/// How vertices make triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Triangles,
    Strip,
    Fan,
}

/// The triangles of one primitive of one node.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// For messages.
    pub(super) node: usize,
    pub(super) primitive: usize,
    pub(super) mode: Mode,
    /// The first vertex of its block, and how many the block has.
    pub(super) first_vertex: u32,
    pub(super) vertices: u32,
    /// Its indices; none if the vertices are used in their order.
    pub(super) indices: Option<Elements>,
}

/// All of a scene.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) blocks: Vec<Block>,
    pub(super) parts: Vec<Part>,
    pub(super) vertices: u32,
    pub(super) faces: u32,
    /// How far apart neighbouring coordinates can be, metres.
    pub(super) spacing_m: f64,
}

impl Layout {
    /// The layout of the default scene.
    pub(super) fn of(path: &Path, container: &Container) -> Result<Self> {
        let Container { document, buffers } = container;
        for name in &document.extensions_required.0 {
            if !HARMLESS.iter().any(|prefix| name.starts_with(prefix)) {
                let hint = Some("export the mesh without compression or quantisation".to_owned());
                let what = format!("the required extension {name:?}");
                return Err(Error::Unsupported { path: path.to_path_buf(), what, hint });
            }
        }
        let mut layout = Self::default();
        for placed in placed_meshes(path, document)? {
            layout.add(&Maker { path, document, buffers, placed })?;
        }
        Ok(layout)
    }

    fn add(&mut self, maker: &Maker<'_>) -> Result<()> {
        let meshes = &maker.document.meshes.0;
        let Some(mesh) = meshes.get(maker.placed.mesh) else {
            let expected = format!("a mesh below {}", meshes.len());
            return Err(maker.corrupt(None, expected, maker.placed.mesh.to_string()));
        };
        // Primitives of a node often share their vertices.
        let mut shared: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let mode = maker.mode(k, primitive)?;
            let accessor = maker.position(k, primitive)?;
            let (first_vertex, vertices) = if let Some(known) = shared.get(&accessor) {
                *known
            } else {
                let (block, spacing_m) = maker.block(k, accessor)?;
                let new = (self.vertices, block.positions.count);
                self.vertices = maker.sum("vertices", self.vertices, new.1)?;
                self.spacing_m = self.spacing_m.max(spacing_m);
                self.blocks.push(block);
                shared.insert(accessor, new);
                new
            };
            let indices = primitive.indices.map(|a| maker.indices(k, a)).transpose()?;
            let corners = indices.map_or(vertices, |indices| indices.count);
            let triangles = match mode {
                Mode::Triangles if !corners.is_multiple_of(3) => {
                    let expected = "a multiple of three corners";
                    return Err(maker.corrupt(Some(k), expected, corners.to_string()));
                }
                Mode::Triangles => corners / 3,
                Mode::Strip | Mode::Fan => corners.saturating_sub(2),
            };
            self.faces = maker.sum("faces", self.faces, triangles)?;
            if self.parts.len() == PART_LIMIT {
                let what = format!("{}: primitives in the scene", maker.path.display());
                let found = PART_LIMIT as u64 + 1;
                return Err(Error::Limit { what, limit: PART_LIMIT as u64, found });
            }
            let node = maker.placed.node;
            self.parts.push(Part { node, primitive: k, mode, first_vertex, vertices, indices });
        }
        Ok(())
    }
}

/// Makes blocks and parts of a node's mesh.
struct Maker<'a> {
    path: &'a Path,
    document: &'a Document,
    buffers: &'a [BufferBytes],
    placed: Placed,
}

impl Maker<'_> {
    fn mode(&self, k: usize, primitive: &Primitive) -> Result<Mode> {
        if primitive.targets.is_some() {
            return Err(self.unsupported(k, "morph targets", "export the mesh in its final form"));
        }
        let name = match primitive.mode {
            None | Some(4) => return Ok(Mode::Triangles),
            Some(5) => return Ok(Mode::Strip),
            Some(6) => return Ok(Mode::Fan),
            Some(0) => "points",
            Some(1..=3) => "lines",
            Some(other) => {
                return Err(self.corrupt(Some(k), "a mode from 0 to 6", other.to_string()));
            }
        };
        Err(self.unsupported(k, &format!("a primitive of {name}"), "export triangles only"))
    }

    /// The accessor of the positions.
    fn position(&self, k: usize, primitive: &Primitive) -> Result<u32> {
        let found = primitive.attributes.position;
        found.ok_or_else(|| self.corrupt(Some(k), "an attribute POSITION", "none"))
    }

    fn block(&self, k: usize, accessor: u32) -> Result<(Block, f64)> {
        let (found, view_stride) = self.accessor(k, accessor, "VEC3")?;
        if found.component_type != F32 {
            let what = format!("accessor {accessor}: positions that are no 32-bit floats");
            return Err(self.unsupported(k, &what, "export the mesh without quantisation"));
        }
        let positions = self.elements(k, accessor, 12, view_stride)?;
        let scene_from_mesh = self.placed.scene_from_mesh;
        // Scaled vertices stand apart by the scale.
        let matrix = scene_from_mesh.matrix3;
        let scale = matrix.x_axis.length().max(matrix.y_axis.length()).max(matrix.z_axis.length());
        let bounds = found.min.0.zip(found.max.0).map(|(min, max)| Bounds3 { min, max });
        let spacing = bounds.map_or(0.0, |bounds| f32_spacing(&bounds));
        Ok((Block { positions, scene_from_mesh }, spacing * scale))
    }

    fn indices(&self, k: usize, accessor: u32) -> Result<Elements> {
        let (found, view_stride) = self.accessor(k, accessor, "SCALAR")?;
        let size = match found.component_type {
            U8 => 1,
            U16 => 2,
            U32 => 4,
            other => {
                let expected = format!("accessor {accessor}: indices of type {U8}, {U16} or {U32}");
                return Err(self.corrupt(Some(k), expected, other.to_string()));
            }
        };
        self.elements(k, accessor, size, view_stride)
    }

    /// An accessor of that shape, and its view's stride.
    fn accessor(&self, k: usize, number: u32, shape: &str) -> Result<(&Accessor, Option<u64>)> {
        let accessors = &self.document.accessors.0;
        let Some(accessor) = accessors.get(number as usize) else {
            let expected = format!("an accessor below {}", accessors.len());
            return Err(self.corrupt(Some(k), expected, number.to_string()));
        };
        if accessor.sparse.is_some() {
            let what = format!("accessor {number}: a sparse accessor");
            return Err(self.unsupported(k, &what, "export the mesh without sparse accessors"));
        }
        if accessor.shape != shape {
            let expected = format!("accessor {number} of type {shape}");
            return Err(self.corrupt(Some(k), expected, accessor.shape.clone()));
        }
        let view = accessor.buffer_view.and_then(|v| self.document.buffer_views.0.get(v));
        Ok((accessor, view.and_then(|view| view.byte_stride)))
    }

    /// The elements of an accessor, which lie within its view and its buffer.
    fn elements(&self, k: usize, number: u32, size: u64, stride: Option<u64>) -> Result<Elements> {
        let accessor = &self.document.accessors.0[number as usize];
        let views = &self.document.buffer_views.0;
        let Some(view) = accessor.buffer_view.and_then(|view| views.get(view)) else {
            let (expected, found) = (format!("accessor {number} with a buffer view"), "none");
            return Err(self.corrupt(Some(k), expected, found));
        };
        let stride = stride.unwrap_or(size);
        if !(size..=252).contains(&stride) {
            let expected = format!("accessor {number}: a stride from {size} to 252");
            return Err(self.corrupt(Some(k), expected, stride.to_string()));
        }
        let count = u32::try_from(accessor.count).or(Err(Error::Limit {
            what: format!("{}: elements of accessor {number}", self.path.display()),
            limit: u32::MAX.into(),
            found: accessor.count,
        }))?;
        // The last element has no gap behind it.
        let bytes = match count {
            0 => 0,
            count => u64::from(count - 1) * stride + size,
        };
        let ends_within = |start: u64, length: u64, whole: u64| {
            start.checked_add(length).is_some_and(|end| end <= whole)
        };
        if !ends_within(accessor.byte_offset, bytes, view.byte_length) {
            let expected =
                format!("accessor {number} within its view of {} bytes", view.byte_length);
            let found = format!("{bytes} bytes from byte {}", accessor.byte_offset);
            return Err(self.corrupt(Some(k), expected, found));
        }
        let buffer_bytes = self.buffers.get(view.buffer).map_or(0, |buffer| buffer.length);
        if !ends_within(view.byte_offset, view.byte_length, buffer_bytes) {
            let expected = format!(
                "accessor {number}: a view within the {buffer_bytes} bytes of buffer {}",
                view.buffer
            );
            let found = format!("{} bytes from byte {}", view.byte_length, view.byte_offset);
            return Err(self.corrupt(Some(k), expected, found));
        }
        let small = |bytes: u64| usize::try_from(bytes).expect("at most 252");
        Ok(Elements {
            buffer: view.buffer,
            offset: view.byte_offset + accessor.byte_offset,
            count,
            size: small(size),
            stride: small(stride),
        })
    }

    /// The sum of two counts.
    fn sum(&self, what: &str, a: u32, b: u32) -> Result<u32> {
        a.checked_add(b).ok_or_else(|| Error::Limit {
            what: format!("number of {what} in {}", self.path.display()),
            limit: u32::MAX.into(),
            found: u64::from(a) + u64::from(b),
        })
    }

    fn place(&self, primitive: Option<usize>) -> String {
        let (node, mesh) = (self.placed.node, self.placed.mesh);
        match primitive {
            Some(k) => format!("node {node}, mesh {mesh}, primitive {k}"),
            None => format!("node {node}"),
        }
    }

    #[cold]
    fn corrupt(
        &self,
        primitive: Option<usize>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::corrupt(self.path, self.place(primitive), expected, found)
    }

    #[cold]
    fn unsupported(&self, primitive: usize, what: &str, hint: &str) -> Error {
        Error::Unsupported {
            path: self.path.to_path_buf(),
            what: format!("{}: {what}", self.place(Some(primitive))),
            hint: Some(hint.to_owned()),
        }
    }
}
