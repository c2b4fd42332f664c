//! `groundel plan --changed`: of a job whose inputs have changed, what still holds is kept.

use std::collections::BTreeMap;
use std::fs;

use super::super::console;
use super::super::ortho::Job;
use super::folder::JobFolder;
use super::record::{JobRecord, PhotoRecord};
use crate::batch::{Parts, TileAddress, keep};
use crate::camera::Photo;
use crate::plan::Reach;
use crate::{Error, Result};

/// The job that stands in the folder before it is planned again.
#[derive(Debug)]
pub(super) struct Earlier {
    record: Option<JobRecord>,
    /// Whether another job may take its place.
    is_change: bool,
}

impl Earlier {
    /// Looks for it.
    ///
    /// # Errors
    /// If there is one that cannot be read; where it is to be replaced, one of another version counts as none.
    pub(super) fn find(folder: &JobFolder, is_change: bool) -> Result<Self> {
        if !folder.manifest().exists() {
            return Ok(Self { record: None, is_change });
        }
        match JobRecord::load(folder) {
            Ok(record) => Ok(Self { record: Some(record), is_change }),
            Err(Error::Corrupt { .. }) if is_change => Ok(Self { record: None, is_change }),
            Err(e) => Err(e),
        }
    }

    /// Its cut into batches, if the new job has the same tiles.
    pub(super) fn batches(&self, new: &JobRecord) -> Option<&[u64]> {
        let record = self.record.as_ref()?;
        record.manifest.is_like(&new.manifest).then_some(&record.batches)
    }
}

/// Puts the record of `job` into its folder, in the place of the earlier one.
///
/// Finished tiles of the same job stay, however it is cut into batches. Of a job with other photos, cameras or masks the
/// tiles stay that none of those that differ may touch, now or before; of a job that differs in anything else, none.
///
/// # Errors
/// [`Error::Usage`] if there is another job and it is not to be changed; failed file operations.
pub(super) fn replace(earlier: Earlier, job: &Job, quiet: bool) -> Result<()> {
    let (folder, new) = (&job.folder, &job.record);
    let parts = folder.parts()?;
    let Some(old) = earlier.record else { return new.save(folder) };
    if old.manifest == new.manifest {
        if old.batches != new.batches {
            release(&parts, &old)?;
        }
        return new.save(folder);
    }
    if !earlier.is_change {
        let folder = folder.path().display();
        return Err(Error::usage(format!(
            "{folder}: holds a job with other inputs or settings: take another folder, or --changed"
        )));
    }
    let kept = match touched(&old, job)? {
        Some(reach) => keep_untouched(&parts, &old, new, &reach)?,
        None => 0,
    };
    new.save(folder)?;
    parts.tidy(&new.manifest)?;
    if !quiet {
        let all = new.manifest.pyramid().tile_count(0);
        console::note(&format!("groundel: {kept} of {all} tiles still hold"));
    }
    Ok(())
}

/// Finished batches of another cut count as tiles, wherever they belong now.
fn release(parts: &Parts, old: &JobRecord) -> Result<()> {
    for batch in 0..old.batch_count() {
        if parts.is_finished(&old.manifest, batch)? {
            let (from, to) = (parts.finished_file(batch), parts.new_kept()?);
            fs::rename(&from, &to).map_err(|e| Error::io(&from, e))?;
        }
    }
    Ok(())
}

/// What the photos that differ may touch; `None` if more than photos differs.
fn touched(old: &JobRecord, job: &Job) -> Result<Option<Reach>> {
    let new = &job.record;
    let is_alike =
        old.manifest.is_like(&new.manifest) && old.common == new.common && old.names == new.names;
    if !is_alike {
        return Ok(None);
    }
    let by_id = |record: &JobRecord| -> BTreeMap<u32, String> {
        record.photos.iter().map(|photo| (photo.id, photo.key.clone())).collect()
    };
    let (before, now) = (by_id(old), by_id(new));
    let differs = |photo: &PhotoRecord| before.get(&photo.id) != now.get(&photo.id);
    let differing = |record: &JobRecord| -> Result<Vec<Photo>> {
        let photos = record.photos(&job.folder)?;
        let both = photos.into_iter().zip(&record.photos);
        Ok(both.filter(|(_, record)| differs(record)).map(|(photo, _)| photo).collect())
    };
    // Where a photo lay before, and where it lies now.
    let mut photos = differing(old)?;
    photos.extend(differing(new)?);
    let side = new.manifest.format().tile_size;
    Ok(Some(Reach::of(&job.scene.mesh, &job.mosaic, side, &photos)))
}

/// Copies the tiles that hold into a part of the new job; how many there are.
fn keep_untouched(parts: &Parts, old: &JobRecord, new: &JobRecord, reach: &Reach) -> Result<usize> {
    let holds = |tile: TileAddress| !reach.meets(&new.manifest.tile_rect(tile));
    let finished = parts.finished(&old.manifest)?;
    let to = parts.new_kept()?;
    let unfinished = to.with_extension("unfinished");
    let kept = keep((&old.manifest, &finished), (&new.manifest, &unfinished), &holds)?;
    if kept > 0 {
        fs::rename(&unfinished, &to).map_err(|e| Error::io(&unfinished, e))?;
    }
    Ok(kept)
}
