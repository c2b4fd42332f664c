//! [`PhotoFolder`]: what camera formats leave to the photos themselves.

use std::path::Path;

use crate::geom::Size;
use crate::input::photo::read_photo_header;
use crate::{Error, Result};

/// The folder of the photos, if it is known.
#[derive(Debug, Clone, Copy)]
pub(in crate::input) struct PhotoFolder<'a>(pub(in crate::input) Option<&'a Path>);

impl PhotoFolder<'_> {
    /// The name below the folder of a photo that a tool knew under `path`: the longest end of it that exists in the
    /// folder, else its last part.
    pub(in crate::input) fn name_of(self, path: &str) -> String {
        let path = path.replace('\\', "/");
        let parts: Vec<&str> = path.split('/').filter(|p| !matches!(*p, "" | "." | "..")).collect();
        let end = |first: usize| parts.get(first..).unwrap_or_default().join("/");
        let is_there = |name: &String| self.0.is_some_and(|folder| folder.join(name).is_file());
        let found = (0..parts.len()).map(end).find(is_there);
        found.unwrap_or_else(|| end(parts.len().saturating_sub(1)))
    }

    /// Width and height of a photo, from its file's header; inside, the reason why the photo cannot be used.
    ///
    /// # Errors
    /// [`Error::Usage`] naming `cameras` if the folder is not known.
    pub(in crate::input) fn size_of(
        self,
        cameras: &Path,
        name: &str,
    ) -> Result<std::result::Result<Size, String>> {
        let Some(folder) = self.0 else {
            let cameras = cameras.display();
            return Err(Error::usage(format!(
                "--photos: {cameras} does not state the sizes of its photos: give their folder"
            )));
        };
        Ok(match read_photo_header(&folder.join(name)) {
            Ok(header) => Ok(header.size),
            Err(error) => Err(format!("its size is not known: {error}")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photo_is_found_by_the_longest_end_of_its_old_path() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("west")).unwrap();
        for name in ["west/a.jpg", "a.jpg"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let photos = PhotoFolder(Some(folder.path()));
        assert_eq!(photos.name_of("/home/user/west/a.jpg"), "west/a.jpg");
        assert_eq!(photos.name_of("D:\\site\\a.jpg"), "a.jpg");
        assert_eq!(photos.name_of("./images/../b.jpg"), "b.jpg");
        assert_eq!(PhotoFolder(None).name_of("x/y.jpg"), "y.jpg");
        assert_eq!(PhotoFolder(None).name_of(""), "");
    }

    #[test]
    fn without_a_folder_there_is_no_size_and_without_a_file_no_photo() {
        let e = PhotoFolder(None).size_of(Path::new("c.csv"), "a.jpg").unwrap_err();
        assert!(e.to_string().contains("c.csv"), "{e}");
        let folder = tempfile::tempdir().unwrap();
        let none = PhotoFolder(Some(folder.path())).size_of(Path::new("c.csv"), "a.jpg").unwrap();
        assert!(none.unwrap_err().contains("a.jpg"));
    }
}
