//! [`TestScene`]: a small mesh, photos, a mosaic frame and a texture, with all answers known.

use std::path::Path;

use glam::DVec3;

use super::photograph::write;
use super::{
    Caster, Depth, Oracle, Part, Placement, PlaneSpec, Refinement, Sampling, Scene, Shot, Sight,
    Texture, names, photograph, photos, write_colmap, write_picture, write_project,
    write_triangles,
};
use crate::camera::CameraSet;
use crate::frame::{Mosaic, Plane};
use crate::geom::FaceId;
use crate::image::{Image, Samples};
use crate::{Error, Result};

/// A scene small enough for the brute-force oracle: a few thousand faces, about ten thousand mosaic pixels.
#[derive(Debug, Clone)]
pub struct TestScene {
    /// What it tests, as a file name.
    pub name: &'static str,
    /// Corners of every face in the ground frame, in the order of their ids, 0, 1, 2, …
    pub triangles: Vec<[DVec3; 3]>,
    /// What each face is part of.
    pub parts: Vec<Part>,
    /// Where the texture stands.
    pub placement: Placement,
    /// The colours.
    pub texture: Texture,
    /// The photos to take.
    pub shots: Vec<Shot>,
    /// The mosaic's frame.
    pub plane: PlaneSpec,
}

impl TestScene {
    /// The mesh of a scene with edges of at most `edge_length_m`, with photos and a frame.
    ///
    /// # Panics
    /// If the mesh is beyond all use in a test, 2³¹ faces or more.
    pub fn of_scene(
        name: &'static str,
        scene: &Scene,
        edge_length_m: f64,
        shots: Vec<Shot>,
        plane: PlaneSpec,
    ) -> Self {
        let mesh = Refinement::by_edge_length(scene, edge_length_m);
        let faces = mesh.expect("a test's mesh is small").triangles();
        let part = |k: u32| scene.patches()[k as usize].part;
        Self {
            name,
            triangles: faces.iter().map(|f| f.0).collect(),
            parts: faces.iter().map(|f| part(f.1)).collect(),
            placement: *scene.placement(),
            texture: scene.texture().clone(),
            shots,
            plane,
        }
    }

    /// Adds a face; its id is the number of faces before it.
    pub fn push(&mut self, triangle: [DVec3; 3], part: Part) {
        self.triangles.push(triangle);
        self.parts.push(part);
    }

    /// The faces' ids: their places in the list.
    pub fn ids(&self) -> Vec<FaceId> {
        (0..).take(self.triangles.len()).map(FaceId).collect()
    }

    /// The oriented photos, numbered by name.
    ///
    /// # Errors
    /// [`Error::Usage`] if a shot makes no photo.
    pub fn photos(&self) -> Result<CameraSet> {
        photos(&self.shots)
    }

    /// The mosaic.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame makes no mosaic.
    pub fn mosaic(&self) -> Result<Mosaic> {
        self.plane.mosaic()
    }

    /// The brute-force oracle over the scene, with a slack of `slack_m` metres.
    pub fn oracle(&self, slack_m: f64) -> Oracle {
        Oracle::new(&self.triangles, &self.ids(), self.plane, slack_m)
    }

    /// A ray caster over the scene, to take photographs.
    pub fn caster(&self) -> Caster {
        let faces: Vec<_> =
            self.triangles.iter().copied().zip(self.parts.iter().copied()).collect();
        Caster::new(&faces, self.placement, self.texture.clone())
    }

    /// The colour (0 to 1) that a mosaic pixel should have where it shows `sight`.
    pub fn colour(&self, oracle: &Oracle, pixel: [u32; 2], sight: &Sight) -> [f64; 3] {
        let ground = oracle.ground(pixel, sight.elevation);
        let part = self.parts[sight.triangle];
        self.texture.colour(self.placement.scene_from_ground(ground), part)
    }

    /// Writes the scene as a project: `mesh.ply`, the photos as the shots' names end, `sparse/`, `frame.toml` and
    /// `project.toml`, which asks for `layers`.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be written; [`Error::Usage`] if a shot makes no photo.
    pub fn write(&self, folder: &Path, sampling: Sampling, layers: &[&str]) -> Result<()> {
        write_colmap(&folder.join(names::CAMERAS), &self.shots)?;
        write_project(folder, &self.plane, layers)?;
        write_triangles(&folder.join(names::MESH), &self.triangles)?;
        let caster = self.caster();
        for photo in self.photos()?.photos {
            let picture = Samples::U8(photograph(&caster, &photo, sampling, 3));
            write_picture(&folder.join(names::PHOTOS).join(&photo.name), &picture)?;
        }
        Ok(())
    }

    /// The mosaic that every surface pixel seen by some photo should come near, `height × width × 3`, and its mask
    /// (255 where there is a surface).
    pub fn expected(&self, oracle: &Oracle) -> (Image<u8>, Image<u8>) {
        let size = self.plane.size();
        let mut colours = Image::filled(size, 3, u8::default());
        let mut mask = Image::filled(size, 1, u8::default());
        for y in 0..size.height {
            for x in 0..size.width {
                let Some(sight) = oracle.surface([x, y]) else { continue };
                let rgb = self.colour(oracle, [x, y], &sight);
                write(colours.pixel_mut(x as usize, y as usize), rgb);
                mask.pixel_mut(x as usize, y as usize)[0] = u8::of_unit(1.0);
            }
        }
        (colours, mask)
    }
}

impl PlaneSpec {
    /// The mosaic of this frame.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame makes no mosaic.
    pub fn mosaic(&self) -> Result<Mosaic> {
        let axes = [self.origin, self.u_axis, self.v_axis].map(|p| p.to_array());
        let plane = Plane::new(axes[0], axes[1], axes[2])
            .map_err(|e| Error::usage(format!("the scene's frame: {e}")))?;
        Mosaic::new(plane, self.pixel_size, self.extent, self.slab())
    }
}
