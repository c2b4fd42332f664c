//! The nodes of the default scene: which meshes stand where.

use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::document::{Document, Node};
use crate::{Error, Result};

/// How far the square of a rotation's length may be from 1: what is left of a quaternion in few digits.
const ROTATION_SLACK: f64 = 1e-2;

/// A mesh where a node puts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    /// The node, for messages.
    pub(super) node: usize,
    pub(super) mesh: usize,
    pub(super) scene_from_mesh: DAffine3,
}

/// The meshes of the default scene, each node before its children, in their order. Without scenes: those of all nodes
/// that are no node's children.
pub(super) fn placed_meshes(path: &Path, document: &Document) -> Result<Vec<Placed>> {
    let nodes = &document.nodes.0;
    let mut placed = Vec::new();
    let mut is_met = vec![false; nodes.len()];
    // The next node is the last.
    let mut waiting: Vec<(usize, DAffine3)> = Vec::new();
    let roots = roots(path, document)?;
    waiting.extend(roots.into_iter().rev().map(|root| (root, DAffine3::IDENTITY)));
    while let Some((k, scene_from_parent)) = waiting.pop() {
        let Some(node) = nodes.get(k) else {
            let expected = format!("a node below {}", nodes.len());
            return Err(Error::corrupt(path, "nodes", expected, k.to_string()));
        };
        if std::mem::replace(&mut is_met[k], true) {
            let place = format!("node {k}");
            return Err(Error::corrupt(path, place, "one parent at most", "two, or a cycle"));
        }
        let parent_from_node = transform(node).map_err(|expected| {
            Error::corrupt(path, format!("node {k}"), expected, "another transform")
        })?;
        let scene_from_mesh = scene_from_parent * parent_from_node;
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                return Err(Error::unsupported(path, format!("node {k}: a skin")));
            }
            placed.push(Placed { node: k, mesh, scene_from_mesh });
        }
        let children = node.children.iter().rev();
        waiting.extend(children.map(|&child| (child as usize, scene_from_mesh)));
    }
    Ok(placed)
}

/// The nodes that the default scene names.
fn roots(path: &Path, document: &Document) -> Result<Vec<usize>> {
    let scenes = &document.scenes.0;
    match (document.scene, scenes.first()) {
        (Some(k), _) => {
            let expected = || format!("a scene below {}", scenes.len());
            let scene = scenes.get(k).map(|scene| scene.nodes.0.clone());
            scene.ok_or_else(|| Error::corrupt(path, "scene", expected(), k.to_string()))
        }
        (None, Some(first)) => Ok(first.nodes.0.clone()),
        (None, None) => {
            let nodes = &document.nodes.0;
            let mut is_root = vec![true; nodes.len()];
            for child in nodes.iter().flat_map(|node| &node.children) {
                if let Some(is_root) = is_root.get_mut(*child as usize) {
                    *is_root = false;
                }
            }
            Ok((0..nodes.len()).filter(|&k| is_root[k]).collect())
        }
    }
}

/// A node's own transform, or what was expected of it.
fn transform(node: &Node) -> std::result::Result<DAffine3, &'static str> {
    if let Some(matrix) = &node.matrix {
        let [a, b, c, d] = [0, 4, 8, 12].map(|k| DVec3::from_slice(&matrix[k..k + 3]));
        // `+ 0.0` turns −0 into 0.
        let last_row = [3, 7, 11, 15].map(|k| (matrix[k] + 0.0).to_bits());
        let is_affine = last_row == [0.0, 0.0, 0.0, 1.0].map(f64::to_bits);
        return if is_affine {
            Ok(DAffine3::from_mat3_translation(DMat3::from_cols(a, b, c), d))
        } else {
            Err("a matrix whose last row is 0, 0, 0, 1")
        };
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    // A NaN fails the comparison too.
    if (rotation.length_squared() - 1.0).abs() < ROTATION_SLACK {
        let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]));
        let translation = DVec3::from_array(node.translation.unwrap_or_default());
        let rotation = if node.rotation.is_some() { rotation.normalize() } else { rotation };
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    } else {
        Err("a rotation of length 1")
    }
}
