//! A model ready to look at images.

use std::path::Path;
use std::sync::{Arc, Mutex};

use ort::session::Session;
use partpose::detection::{DetectedSize, Detection, ModelProbabilities};
use partpose::files::RgbImage;
use partpose::geometry::{Extent, Rect};
use partpose::parts::{PartMask, PartProbabilities};

use crate::image::{Placement, input};
use crate::mapping::{Mapping, Meaning, OutputMapping, PartValues, PartsMapping};
use crate::tensor::{Output, read};
use crate::{OnnxError, library, parts};

/// Boxes of an image at most; a model that says more is not meant.
const MOST_BOXES: usize = 10_000;

/// A model with what its inputs and outputs mean.
#[derive(Debug)]
pub struct OnnxDetector {
    /// Running changes the session.
    session: Mutex<Session>,
    input: String,
    mapping: Mapping,
    meanings: Vec<Meaning>,
    models: Arc<[String]>,
}

impl OnnxDetector {
    /// Prepares a model, the bytes of an ONNX file, on processors.
    ///
    /// `library`: ONNX Runtime's, looked for if it is not given ([`library::find`]).
    pub fn new(model: &[u8], mapping: Mapping, library: Option<&Path>) -> Result<Self, OnnxError> {
        let meanings = mapping.meanings()?;
        let environment = library::open(library)?;
        let failed = |source| OnnxError::Runtime { what: "the model".to_owned(), source };
        let mut builder = Session::builder(&environment).map_err(failed)?;
        let session = builder.commit_from_memory(model).map_err(failed)?;
        let known: Vec<&str> = session.inputs().iter().map(ort::value::Outlet::name).collect();
        let named = |name: &str| OnnxError::Name {
            kind: "input",
            name: name.to_owned(),
            known: known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
        };
        let wanted = mapping.input.name.as_str();
        let input = match known.first() {
            Some(first) if wanted.is_empty() => (*first).to_owned(),
            _ if known.contains(&wanted) => wanted.to_owned(),
            _ => return Err(named(wanted)),
        };
        let models = mapping.models.clone().into();
        Ok(Self { session: Mutex::new(session), input, mapping, meanings, models })
    }

    /// The vehicles of an image, best first.
    pub fn detect(&self, image: &RgbImage) -> Result<Vec<Detection>, OnnxError> {
        let failed = |source| OnnxError::Runtime { what: "the image".to_owned(), source };
        let placement = Placement::new(image.size, self.mapping.input.resize)?;
        let value = input(image, &placement, &self.mapping.input).map_err(failed)?;
        let mut session = self.session.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let outputs = session.run(ort::inputs![self.input.as_str() => value]).map_err(failed)?;
        let rows = Rows::read(&|name| read(&outputs, name), &self.mapping)?;
        let parts = match &self.mapping.output.parts {
            PartsMapping::Boxes { name, .. }
            | PartsMapping::Image { name, .. }
            | PartsMapping::Instances { masks: name, .. } => read(&outputs, name)?,
        };
        drop(outputs);
        drop(session);
        self.found(&rows, parts, &placement)
    }

    fn found(
        &self,
        rows: &Rows,
        parts: Output,
        placement: &Placement,
    ) -> Result<Vec<Detection>, OnnxError> {
        let output = &self.mapping.output;
        let meaning = |place: usize| match &rows.labels {
            Some(labels) => {
                let label = labels[place];
                let known = (label >= 0.0).then(|| self.meanings.get(label as usize)).flatten();
                known.copied().unwrap_or(Meaning::Nothing)
            }
            None => Meaning::Vehicle,
        };
        let sure: Vec<(usize, f32, Meaning)> = (0..rows.scores.len())
            .filter(|place| rows.scores[*place] >= output.min_score)
            .map(|place| (place, rows.scores[place], meaning(place)))
            .collect();
        let grids = Grids::new(output, parts, &sure, (rows.scores.len(), &self.meanings))?;
        let mut found = Vec::new();
        for (place, score, _) in sure.into_iter().filter(|sure| sure.2 == Meaning::Vehicle) {
            let bounds = placement.in_input(rows.boxes[place], output);
            // Comparisons fail for what is no number.
            if !(bounds.width() > 0.0 && bounds.height() > 0.0 && (0.0..=1.0).contains(&score)) {
                continue;
            }
            let probabilities = grids.of(place, &bounds, placement, &self.meanings)?;
            let bounds = placement.rect_in_image(&bounds);
            let models = rows.models.as_ref().map(|rows| ModelProbabilities {
                names: Arc::clone(&self.models),
                values: rows[place].clone(),
            });
            let size = rows.sizes.as_ref().map(|sizes| sizes[place]);
            let detection = Detection::new(bounds, f64::from(score), probabilities);
            found.push(Detection { size, models, ..detection });
        }
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }
}

/// What a model says of each box.
struct Rows {
    boxes: Vec<[f32; 4]>,
    scores: Vec<f32>,
    labels: Option<Vec<f32>>,
    sizes: Option<Vec<DetectedSize>>,
    models: Option<Vec<Vec<f32>>>,
}

impl Rows {
    fn read(
        read: &dyn Fn(&str) -> Result<Output, OnnxError>,
        mapping: &Mapping,
    ) -> Result<Self, OnnxError> {
        let output = &mapping.output;
        let boxes = read(&output.boxes)?.with_axes(2)?;
        let count = boxes.shape[0];
        if boxes.shape[1] != 4 || count > MOST_BOXES {
            return Err(boxes.wrong(&format!("[n, 4] with at most {MOST_BOXES} boxes")));
        }
        let column = |name: &str| -> Result<Vec<f32>, OnnxError> {
            let column = read(name)?;
            if column.values.len() == count {
                Ok(column.values)
            } else {
                Err(column.wrong(&format!("[{count}], one a box")))
            }
        };
        let labels = (!output.labels.is_empty()).then(|| column(&output.labels)).transpose()?;
        let rows = |name: &str, columns: usize| -> Result<Option<Vec<Vec<f32>>>, OnnxError> {
            if name.is_empty() {
                return Ok(None);
            }
            let table = read(name)?.with_axes(2)?;
            if table.shape != [count, columns] || columns == 0 {
                return Err(table.wrong(&format!("[{count}, {columns}]")));
            }
            Ok(Some(table.values.chunks_exact(columns).map(<[f32]>::to_vec).collect()))
        };
        let extents = rows(&output.extents, 3)?;
        let sigmas = rows(&output.extent_sigmas, 3)?;
        let size = |(place, sides): (usize, &Vec<f32>)| {
            let extent = Extent::new(sides[0].into(), sides[1].into(), sides[2].into());
            let sigma = sigmas
                .as_ref()
                .map_or([0.0; 3], |all| [0, 1, 2].map(|axis| f64::from(all[place][axis])));
            DetectedSize { extent, sigma }
        };
        Ok(Self {
            scores: column(&output.scores)?,
            labels,
            sizes: extents.map(|extents| extents.iter().enumerate().map(size).collect()),
            models: rows(&output.models, mapping.models.len())?,
            boxes: boxes.values.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]).collect(),
        })
    }
}

/// Where the part probabilities of boxes come from.
enum Grids {
    Boxes(Output, PartValues),
    Labels(PartMask, usize),
}

impl Grids {
    fn new(
        mapping: &OutputMapping,
        parts: Output,
        sure: &[(usize, f32, Meaning)],
        (count, meanings): (usize, &[Meaning]),
    ) -> Result<Self, OnnxError> {
        let one_a_box = |parts: &Output| {
            let fits = parts.shape.first() == Some(&count);
            if fits { Ok(()) } else { Err(parts.wrong(&format!("[{count}, ..], one a box"))) }
        };
        match &mapping.parts {
            PartsMapping::Boxes { values, .. } => {
                let parts = parts.with_axes(4)?;
                one_a_box(&parts)?;
                Ok(Self::Boxes(parts, *values))
            }
            PartsMapping::Instances { threshold, kernel, .. } => {
                one_a_box(&parts)?;
                let labels = parts::painted(&parts, *threshold, sure.to_vec())?;
                Ok(Self::Labels(labels, *kernel))
            }
            PartsMapping::Image { kernel, .. } => {
                let labels = parts::of_image(&parts, meanings)?;
                Ok(Self::Labels(labels, *kernel))
            }
        }
    }

    fn of(
        &self,
        place: usize,
        bounds: &Rect,
        placement: &Placement,
        meanings: &[Meaning],
    ) -> Result<PartProbabilities, OnnxError> {
        match self {
            Self::Boxes(grids, values) => parts::of_box(grids, place, *values, meanings),
            Self::Labels(labels, kernel) => {
                Ok(parts::of_labels(labels, bounds, placement.size, *kernel))
            }
        }
    }
}
