//! Reading within limits, writing whole or not at all.
//!
//! Every file from outside comes in through here, so that a forged size cannot exhaust memory; every file that others
//! rely on goes out through [`write()`], so that an interrupted run leaves no half of one.

mod labels;
mod photo;

use std::{
    fs::{self, File},
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

pub use labels::{
    LabelImageError, Labels, encode_gray16_png, encode_indexed_png, read_gray16, read_indices,
};
pub use photo::{Photo, decode_photo, photo_size, read_photo};

/// Largest text or model file that is read, bytes.
pub const MAX_FILE: u64 = 1 << 30;
/// Largest width or height of an image that is read, pixels.
pub const MAX_IMAGE_SIDE: u32 = 16_384;
/// Most memory that decoding an image may take, bytes.
const MAX_IMAGE_ALLOC: u64 = 256 << 20;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system refused to read.
    #[error("cannot read `{path}`")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The operating system refused to write.
    #[error("cannot write `{path}`")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file where a folder is to be written to.
    #[error("`{path}` is a file, not a folder")]
    NotAFolder {
        /// The file.
        path: PathBuf,
    },
    /// Larger than anything of its kind should be.
    #[error("`{path}` has {size} bytes, more than the {limit} that are read")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size in bytes.
        size: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// Not UTF-8 where text was expected.
    #[error("`{path}` is not text: byte {offset} is not UTF-8")]
    NotText {
        /// The file.
        path: PathBuf,
        /// Where the first invalid byte is.
        offset: usize,
    },
    /// Not an image, damaged, or too large.
    #[error("cannot decode the image `{path}`")]
    Image {
        /// The file.
        path: PathBuf,
        /// What the decoder says.
        source: image::ImageError,
    },
}

impl FileError {
    /// What the system says to an attempt to read a file or to list a folder.
    pub fn read(path: &Path, source: io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    /// What the system says to an attempt to write a file or to create a folder.
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }
}

/// An 8-bit RGB image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// `width * height * 3` bytes, row by row.
    pub pixels: Vec<u8>,
}

/// The whole file, if it is no larger than [`MAX_FILE`].
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    let file = File::open(path).map_err(|source| FileError::read(path, source))?;
    let size = file.metadata().map_err(|source| FileError::read(path, source))?.len();
    if size > MAX_FILE {
        return Err(FileError::TooLarge { path: path.to_owned(), size, limit: MAX_FILE });
    }
    let mut bytes = Vec::with_capacity(size as usize);
    // A pipe or a growing file may hold more than its metadata says.
    let read = file.take(MAX_FILE + 1).read_to_end(&mut bytes);
    read.map_err(|source| FileError::read(path, source))?;
    if bytes.len() as u64 > MAX_FILE {
        let size = bytes.len() as u64;
        return Err(FileError::TooLarge { path: path.to_owned(), size, limit: MAX_FILE });
    }
    Ok(bytes)
}

/// The whole file as UTF-8 text.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    String::from_utf8(read(path)?).map_err(|error| FileError::NotText {
        path: path.to_owned(),
        offset: error.utf8_error().valid_up_to(),
    })
}

/// A PNG or JPEG image as 8-bit RGB.
pub fn read_rgb(path: &Path) -> Result<RgbImage, FileError> {
    let failed = |source| FileError::Image { path: path.to_owned(), source };
    let bytes = read(path)?;
    let mut reader = image::ImageReader::new(io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|source| FileError::read(path, source))?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    limits.max_alloc = Some(MAX_IMAGE_ALLOC);
    reader.limits(limits);
    let image = reader.decode().map_err(failed)?.into_rgb8();
    Ok(RgbImage { size: [image.width(), image.height()], pixels: image.into_raw() })
}

/// Width and height of a PNG or JPEG image in pixels, from its header alone.
pub fn image_size(path: &Path) -> Result<[u32; 2], FileError> {
    let file = File::open(path).map_err(|source| FileError::read(path, source))?;
    let reader = image::ImageReader::new(io::BufReader::new(file)).with_guessed_format();
    let reader = reader.map_err(|source| FileError::read(path, source))?;
    let failed = |source| FileError::Image { path: path.to_owned(), source };
    let (width, height) = reader.into_dimensions().map_err(failed)?;
    Ok([width, height])
}

/// Writes a file as a whole: into a temporary file beside it, which then takes its name.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_with(path, &mut |out| out.write_all(bytes))
}

/// The same for what is too large to be held: `fill` writes it piece by piece.
pub fn write_with(
    path: &Path,
    fill: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FileError> {
    let failed = |source| FileError::write(path, source);
    let folder = or_here(path.parent().unwrap_or(Path::new("")));
    make_folders(folder)?;
    let mut file = temporary_file(folder).map_err(failed)?;
    let mut buffer = io::BufWriter::new(file.as_file_mut());
    fill(&mut buffer).and_then(|()| buffer.flush()).map_err(failed)?;
    drop(buffer);
    file.as_file().sync_all().map_err(failed)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; what we write is meant to be read.
        let mode = fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(mode).map_err(failed)?;
    }
    file.persist(path).map_err(|error| failed(error.error))?;
    #[cfg(unix)]
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed)?;
    Ok(())
}

/// Creates a folder with its parents, unless it is there, and makes sure that files can be written into it.
///
/// For those who are to write there after hours of work: what would fail then fails now.
pub fn create_folder(path: &Path) -> Result<(), FileError> {
    let path = or_here(path);
    make_folders(path)?;
    let failed = |source| FileError::write(path, source);
    let mut probe = temporary_file(path).map_err(failed)?;
    // A full disk takes the name of a file, but no content.
    probe.write_all(b"partpose").map_err(failed)?;
    probe.close().map_err(failed)
}

fn make_folders(path: &Path) -> Result<(), FileError> {
    fs::create_dir_all(path).map_err(|source| {
        match path.ancestors().map(or_here).find(|ancestor| ancestor.exists()) {
            Some(file) if !file.is_dir() => FileError::NotAFolder { path: file.to_owned() },
            _ => FileError::write(path, source),
        }
    })
}

/// A file that vanishes unless it is given a name; errors do not tell its random one.
fn temporary_file(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    tempfile::NamedTempFile::new_in(folder).map_err(|error| error.kind().into())
}

/// An empty path means the folder that the program runs in.
fn or_here(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// Writes an RGB image as PNG.
pub fn write_png(path: &Path, image: &RgbImage) -> Result<(), FileError> {
    write(path, &encode_png(image))
}

/// An RGB image as the bytes of a PNG file.
pub fn encode_png(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.size[0], image.size[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().expect("writing to memory does not fail");
    writer.write_image_data(&image.pixels).expect("the pixels fill the size");
    writer.finish().expect("writing to memory does not fail");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_file_is_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.txt");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(read_text(&path).unwrap(), "two");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn image_survives_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = RgbImage { size: [3, 2], pixels: (0..18).collect() };
        write_png(&path, &image).unwrap();
        assert_eq!(read_rgb(&path).unwrap(), image);
        assert_eq!(image_size(&path).unwrap(), [3, 2]);
    }

    #[test]
    fn missing_file_is_named() {
        let error = read(Path::new("/nowhere/x.txt")).unwrap_err();
        assert_eq!(error.to_string(), "cannot read `/nowhere/x.txt`");
    }

    #[test]
    fn created_folder_is_empty_and_may_exist() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b");
        for _ in 0..2 {
            create_folder(&path).unwrap();
            assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
        }
        create_folder(Path::new("")).unwrap();
    }

    #[test]
    fn a_file_in_the_place_of_a_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out");
        write(&file, b"text").unwrap();
        let expected = format!("`{}` is a file, not a folder", file.display());
        for path in [file.clone(), file.join("deep/er")] {
            assert_eq!(create_folder(&path).unwrap_err().to_string(), expected);
            assert_eq!(write(&path.join("x"), b"").unwrap_err().to_string(), expected);
        }
        let error = write(folder.path(), b"").unwrap_err();
        assert_eq!(error.to_string(), format!("cannot write `{}`", folder.path().display()));
    }
}
