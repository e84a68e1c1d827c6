//! The models that a pose is chosen from, and the folder that holds them.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::files::{self, FileError};
use crate::geometry::Extent;

use super::{
    GlbError, ParametricVehicle, PartialModel, VehicleModel, from_glb, to_glb, to_partial_glb,
};

/// How to come by a zoo.
const WHERE_FROM: &str = "a zoo is a folder of `.glb` models or one of them: `partpose zoo carve` makes one from part masks, \
                          `partpose demo --out DIR` writes one to begin with into `DIR/zoo`";

/// What the name of a file ends in, before `.glb`, that holds faces without a part.
const PARTIAL: &str = ".partial";

/// Models in a fixed order; where errors tie, the first wins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelZoo {
    /// The models.
    pub models: Vec<VehicleModel>,
}

/// Why a zoo could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ZooError {
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that holds no model.
    #[error("cannot read the model `{path}`")]
    Model {
        /// The file.
        path: PathBuf,
        /// Why.
        source: GlbError,
    },
    /// No model at all.
    #[error("the zoo `{path}` holds no `.glb` file")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// Two models of one name.
    #[error("`{first}` and `{second}` both hold a model named `{name}`")]
    Duplicate {
        /// The name.
        name: String,
        /// The file read first.
        first: PathBuf,
        /// The other file.
        second: PathBuf,
    },
    /// A name that cannot be that of a file, or that two models have.
    #[error("the model name `{name}` cannot name a file of its own")]
    Name {
        /// The name.
        name: String,
    },
    /// A model of another zoo would get mixed in.
    #[error("the folder holds `{path}`, which is not of this zoo")]
    Occupied {
        /// The file in the way.
        path: PathBuf,
    },
}

impl ZooError {
    /// What can be done about it, where the message does not say it already.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::File(FileError::Read { source, .. })
                if source.kind() == io::ErrorKind::NotFound =>
            {
                Some(WHERE_FROM.to_owned())
            }
            Self::File(_) => None,
            Self::Model { source, .. } => Some(source.remedy().to_owned()),
            Self::Empty { .. } => Some(WHERE_FROM.to_owned()),
            Self::Duplicate { second, .. } => {
                Some(format!("remove `{}` or rename its model", second.display()))
            }
            Self::Name { .. } => {
                Some("use letters, digits, `_`, `-` and `.`, each name once".to_owned())
            }
            Self::Occupied { .. } => Some("choose an empty folder".to_owned()),
        }
    }
}

impl ModelZoo {
    /// The models that come with the library, all of them parametric: [`ParametricVehicle::all`].
    ///
    /// They are built at every call, on all threads: about a tenth of a second.
    pub fn embedded() -> Self {
        let vehicles = ParametricVehicle::all();
        let build = |vehicle: &ParametricVehicle| vehicle.build().expect("a test builds them");
        Self { models: vehicles.par_iter().map(build).collect() }
    }

    /// Reads a folder of `.glb` files in the order of their names, or a single file.
    ///
    /// A zoo that holds no model is an error: nothing can be fitted with it. `NAME.partial.glb`, of which some faces
    /// have no part yet, is an error too, unless `NAME.glb`, which was made of it, lies beside it.
    pub fn load(path: &Path) -> Result<Self, ZooError> {
        let files = Self::files(path)?;
        let mut models: Vec<VehicleModel> = Vec::new();
        for file in &files {
            let model = from_glb(&files::read(file)?)
                .map_err(|source| ZooError::Model { path: file.clone(), source })?;
            if let Some(first) = models.iter().position(|other| other.name() == model.name()) {
                let (first, second) = (files[first].clone(), file.clone());
                return Err(ZooError::Duplicate { name: model.name().to_owned(), first, second });
            }
            models.push(model);
        }
        Ok(Self { models })
    }

    /// The `.glb` files that a folder holds models in, in the order of their names, or the single file itself.
    pub fn files(path: &Path) -> Result<Vec<PathBuf>, ZooError> {
        let files = if path.is_dir() { glb_files(path)? } else { vec![path.to_owned()] };
        if files.is_empty() {
            return Err(ZooError::Empty { path: path.to_owned() });
        }
        Ok(files)
    }

    /// Writes a folder of one `NAME.glb` a model, which is made if need be; read back, models are in order of names.
    ///
    /// Files of equal name are replaced. A folder with other `.glb` files is refused before anything is written,
    /// because they would become part of the zoo.
    pub fn save(&self, path: &Path) -> Result<(), ZooError> {
        let mut names: Vec<String> = Vec::new();
        for model in &self.models {
            let name = format!("{}.glb", model.name());
            // Some file systems take `a.glb` and `A.glb` for one file.
            if !can_name_a_file(model.name())
                || names.iter().any(|other| other.eq_ignore_ascii_case(&name))
            {
                return Err(ZooError::Name { name: model.name().to_owned() });
            }
            names.push(name);
        }
        if path.is_dir() {
            for file in glb_files(path)? {
                if !names.iter().any(|name| file.file_name().is_some_and(|other| other == &**name))
                {
                    return Err(ZooError::Occupied { path: file });
                }
            }
        }
        for (model, name) in self.models.iter().zip(&names) {
            files::write(&path.join(name), &to_glb(model))?;
        }
        Ok(())
    }

    /// Writes one model into a folder beside those that are there, and gives the file: `NAME.glb`, or
    /// `NAME.partial.glb` if faces have no part.
    ///
    /// A file of equal name is replaced.
    pub fn add_to(path: &Path, model: &PartialModel) -> Result<PathBuf, ZooError> {
        if !can_name_a_file(&model.name) || model.name.ends_with(PARTIAL) {
            return Err(ZooError::Name { name: model.name.clone() });
        }
        let ending = if model.unlabeled() > 0 { PARTIAL } else { "" };
        let file = path.join(format!("{}{ending}.glb", model.name));
        files::write(&file, &to_partial_glb(model))?;
        Ok(file)
    }

    /// The model with a name.
    pub fn get(&self, name: &str) -> Option<&VehicleModel> {
        self.models.iter().find(|model| model.name() == name)
    }

    /// The model of a category whose extent is nearest in the L1 sense (paper, § III-A).
    pub fn closest(&self, category: &str, extent: &Extent) -> Option<&VehicleModel> {
        let candidates = self.models.iter().filter(|model| model.category() == category);
        candidates.min_by(|a, b| {
            a.extent().l1_distance(extent).total_cmp(&b.extent().l1_distance(extent))
        })
    }
}

/// The `.glb` files of a folder, sorted by name.
///
/// Hidden ones are left out, and `NAME.partial.glb` where the finished `NAME.glb` is there.
fn glb_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let failed = |source| FileError::read(folder, source);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_glb =
            path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
        let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes()[0] == b'.');
        if is_glb && !is_hidden {
            files.push(path);
        }
    }
    files.sort();
    let all = files.clone();
    files.retain(|file| {
        let stem = file.file_stem().and_then(|stem| stem.to_str());
        let finished = stem.and_then(|stem| stem.strip_suffix(PARTIAL));
        !finished.is_some_and(|name| all.contains(&folder.join(format!("{name}.glb"))))
    });
    Ok(files)
}

fn can_name_a_file(name: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || "_-. ".contains(c);
    (1..=100).contains(&name.len()) && name.chars().all(fits) && !name.starts_with(['.', ' '])
}
