//! Building a mesh store, or opening one that has been built.
//!
//! In: meshes as streams, a work folder, a memory budget. Out: an open [`MeshStore`]. The readings of the meshes, in
//! order: bounds → lattice; vertices → lattice points; faces → buckets along the curve; buckets → sorted → cut →
//! encoded → written. Promises: the file's bytes depend on the meshes alone; under its final name there is a whole
//! store or none; of two processes that want the same store one builds it.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::buckets::Buckets;
use super::curve::{COARSE_CELLS, Curve};
use super::cut::Cutter;
use super::key::MeshKey;
use super::lattice::Lattice;
use super::layout::{MeshCounts, Node};
use super::order::{Sink, Sorter};
use super::partition::Triangle;
use super::place::{Placement, survey};
use super::plan::{MeshDiskForecast, Plan};
use super::progress::{BuildStage, Meter, OnProgress};
use super::read::MeshStore;
use super::scatter::{Scatter, Scattered};
use super::write::StoreWriter;
use crate::geom::MeshSource;
use crate::{Error, Result};

/// Where and within what a store is built.
#[derive(Debug, Clone)]
pub struct MeshBuild {
    /// The work folder; made if there is none.
    pub work: PathBuf,
    /// Working memory of the building, bytes. The process as a whole peaked at 1.2 times 120 MiB (30 M faces: 116 MB,
    /// 3 M: 152 MB): the reader's buffers, and what the allocator keeps, come on top.
    pub budget_bytes: usize,
    /// As for [`MeshStore::open`].
    pub resident_limit_bytes: u64,
}

impl MeshBuild {
    /// The file of the store with that key.
    pub fn store_path(&self, key: MeshKey) -> PathBuf {
        self.work.join(format!("mesh-{}.store", key.hex()))
    }

    /// The disk that building a store takes.
    pub fn forecast(&self, sources: &[&dyn MeshSource]) -> MeshDiskForecast {
        self.plan(sources).forecast()
    }

    /// Whether there is a store of these meshes; it may turn out to be damaged.
    ///
    /// # Errors
    /// [`Error::Io`] if a mesh cannot be read.
    pub fn is_built(&self, sources: &[&dyn MeshSource]) -> Result<bool> {
        Ok(self.store_path(MeshKey::of(sources)?).exists())
    }

    /// Opens the store of these meshes, whose faces are numbered on in the order given; builds it if there is
    /// none, or if it is damaged. Runs on rayon's current threads.
    ///
    /// # Errors
    /// Those of the meshes; [`Error::Corrupt`] for a face that uses a vertex which is not finite, or a file that
    /// changes while it is read; [`Error::Limit`] for more faces than 32 bits can number; [`Error::Io`]; what
    /// `on_progress` returns. Nothing is left then.
    pub fn open_or_build(
        &self,
        sources: &[&dyn MeshSource],
        on_progress: OnProgress<'_>,
    ) -> Result<MeshStore> {
        let key = MeshKey::of(sources)?;
        std::fs::create_dir_all(&self.work).map_err(|e| Error::io(&self.work, e))?;
        let path = self.store_path(key);
        if let Some(store) = self.open_built(&path, key)? {
            return Ok(store);
        }
        // One writer at a time; whoever waited finds the store built.
        let _lock = lock(&path.with_extension("lock"))?;
        if let Some(store) = self.open_built(&path, key)? {
            return Ok(store);
        }
        let folder = TemporaryFolder::new(path.with_extension("tmp"))?;
        let job = Job { sources, key, folder: &folder.0, plan: self.plan(sources) };
        job.run(&path, Meter(on_progress), || unchanged(sources, key))?;
        MeshStore::open(&path, self.resident_limit_bytes)
    }

    /// The store at `path`, or `None` if there is none, or none that can be used.
    fn open_built(&self, path: &Path, key: MeshKey) -> Result<Option<MeshStore>> {
        match MeshStore::open(path, self.resident_limit_bytes) {
            Ok(store) => Ok(Some(store).filter(|store| store.key() == key)),
            Err(Error::Corrupt { .. } | Error::Unsupported { .. }) => Ok(None),
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn plan(&self, sources: &[&dyn MeshSource]) -> Plan {
        let vertices = sources.iter().map(|s| s.vertex_count()).sum();
        Plan::new(self.budget_bytes, vertices, sources.iter().map(|s| s.face_count()).sum())
    }
}

/// One building of a store.
struct Job<'a> {
    sources: &'a [&'a dyn MeshSource],
    key: MeshKey,
    folder: &'a Path,
    plan: Plan,
}

impl Job<'_> {
    fn run(
        &self,
        path: &Path,
        mut meter: Meter<'_>,
        check: impl FnOnce() -> Result<()>,
    ) -> Result<()> {
        let first_ids = first_ids(self.sources)?;
        // 1. Bounds, and with them the lattice and the curve.
        let survey = survey(self.sources, &self.plan, &mut meter)?;
        let mut counts = MeshCounts {
            faces: self.sources.iter().map(|s| s.face_count()).sum(),
            vertices: self.sources.iter().map(|s| s.vertex_count()).sum(),
            vertices_unusable: survey.unusable,
            ..MeshCounts::default()
        };
        let lattice = Lattice::of(&survey.bounds);
        let corners = [survey.bounds.min, survey.bounds.max].map(|p| lattice.point(p));
        let bounds = match corners {
            [Some(min), Some(max)] => Node { min, max },
            _ => Node { min: [0; 3], max: [0; 3] },
        };
        let curve = Curve::new(&bounds, counts.faces);
        // 2. Vertices onto the lattice.
        let placement = Placement { plan: &self.plan, lattice: &lattice, curve: &curve };
        let mut cells = vec![0; COARSE_CELLS];
        let (mut vertices, mut done) = (Vec::new(), 0);
        for (k, (source, &usable)) in self.sources.iter().zip(&survey.usable).enumerate() {
            let file = self.folder.join(format!("vertices-{k}"));
            let file = (!self.plan.holds_vertices).then_some(file);
            vertices.push(placement.place(*source, usable, file, &mut cells)?);
            done += source.vertex_count();
            meter.tell(BuildStage::Vertices, done, counts.vertices)?;
        }
        // 3. Faces into buckets.
        let ranges = self.plan.ranges(&cells);
        drop(cells);
        let (spill, is_held) = (self.plan.spill_bytes, self.plan.holds_triangles);
        let buckets = Buckets::new(self.folder, "bucket", ranges, spill, is_held);
        let chunk = self.plan.chunk;
        let mut scatter = Scatter { curve, buckets, chunk, counts, meter };
        for ((&source, vertices), &first_id) in self.sources.iter().zip(vertices).zip(&first_ids) {
            let (folder, join_bytes) = (self.folder, self.plan.cache_bytes);
            scatter.scatter(Scattered { source, first_id, folder, join_bytes }, vertices)?;
        }
        let Scatter { buckets, meter, counts: found, .. } = scatter;
        counts = found;
        // 4. Sorted, cut, encoded, written.
        let sorter = Sorter {
            folder: self.folder,
            capacity: self.plan.capacity,
            spill_bytes: self.plan.spill_bytes,
        };
        let cutter = Cutter::new(StoreWriter::new(self.folder)?);
        let mut metered = Metered { cutter, meter, done: 0, total: counts.triangles };
        sorter.run(buckets, &mut metered)?;
        let writer = metered.cutter.finish()?;
        check()?;
        writer.finish(path, self.key, lattice, counts)
    }
}

/// A cutter that tells of its progress.
struct Metered<'a> {
    cutter: Cutter,
    meter: Meter<'a>,
    done: u64,
    total: u64,
}

impl Sink for Metered<'_> {
    fn take(&mut self, triangles: &[Triangle]) -> Result<()> {
        self.cutter.take(triangles)?;
        self.done += triangles.len() as u64;
        self.meter.tell(BuildStage::Partitions, self.done, self.total)
    }
}

/// The id of each mesh's first face.
fn first_ids(sources: &[&dyn MeshSource]) -> Result<Vec<u32>> {
    let (mut ids, mut next) = (Vec::new(), 0_u64);
    let limit = u64::from(u32::MAX);
    for source in sources {
        let first = u32::try_from(next);
        next = next.saturating_add(source.face_count());
        let Some(first) = first.ok().filter(|_| next <= limit) else {
            let what = format!("number of faces up to {}", source.path().display());
            return Err(Error::Limit { what, limit, found: next });
        };
        ids.push(first);
    }
    Ok(ids)
}

/// An error if the files are no longer those that the key was made of.
fn unchanged(sources: &[&dyn MeshSource], key: MeshKey) -> Result<()> {
    if MeshKey::of(sources)? == key {
        return Ok(());
    }
    let names: Vec<String> = sources.iter().map(|s| s.path().display().to_string()).collect();
    let place = "content, while it was read";
    Err(Error::corrupt(names.join(", "), place, "no change", "a change"))
}

/// Holds the lock file, until it is dropped.
pub(in crate::store) fn lock(path: &Path) -> Result<File> {
    let io = |e| Error::io(path, e);
    let file = File::options().create(true).truncate(false).write(true).open(path).map_err(io)?;
    file.lock().map_err(io)?;
    Ok(file)
}

/// A folder for temporary files, emptied before and removed after.
#[derive(Debug)]
pub(in crate::store) struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    /// An empty folder at `path`.
    pub(in crate::store) fn new(path: PathBuf) -> Result<Self> {
        match std::fs::remove_dir_all(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(path, e)),
            _ => {}
        }
        std::fs::create_dir(&path).map_err(|e| Error::io(&path, e))?;
        Ok(Self(path))
    }

    /// Where it is.
    pub(in crate::store) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // What is left is removed before the next building of this store.
        drop(std::fs::remove_dir_all(&self.0));
    }
}
