//! The flags of the pose stage, shared by every command that estimates poses.

use clap::ValueEnum;
use partpose::parts::Scaling;
use partpose::pose::dense::DenseOptions;
use partpose::pose::{
    Center2d, Center3d, DEFAULT_SMALL_PART, PartFilters, PnpMethod, PoseOptions, Ranking,
};

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct PoseFlags {
    /// How kernels become masks
    #[arg(long, value_enum, default_value = "bilinear")]
    scaling: ScalingFlag,
    /// How poses are found: densely, from every probability of the mask, where the flags of centres, scaling and filters
    /// have no say; or with a solver for the centres of parts, the paper's being `epnp`
    #[arg(long, value_enum, default_value = "dense")]
    fit: FitFlag,
    /// What models are compared by when poses come from the centres of parts: the paper's reprojection error alone, or also
    /// what the network says of models and how far a size that is given lies from theirs
    #[arg(long, value_enum, default_value = "error")]
    rank: RankFlag,
    /// Refine with Levenberg-Marquardt, robust and weighted by each part's spread
    #[arg(long)]
    refine: bool,
    /// Point of the image that stands for a part: centre of mass, or of the rectangle
    #[arg(long, value_enum, default_value = "rect")]
    points_2d: Points2d,
    /// Point of the model that stands for a part: centre of mass, of the cuboid, or of what is visible
    #[arg(long, value_enum, default_value = "cub")]
    points_3d: Points3d,
    /// Filters of parts, separated by commas, or `none`. sp: drop parts that fill too little of the box; wl: but keep
    /// lights and mirrors; bl: drop aprons, sides and roof; cfix: drop parts that the image's border cuts
    #[arg(long, value_name = "LIST", value_parser = filters, default_value = "sp,wl,bl,cfix")]
    filters: Filters,
    /// Share of the box that a part must exceed under `sp`
    #[arg(long, value_name = "SHARE", default_value_t = DEFAULT_SMALL_PART, value_parser = share)]
    small_part: f64,
    /// Outermost rows and columns of the image that count as its border under `cfix`
    #[arg(long, value_name = "PIXELS", default_value_t = 1, value_parser = clap::value_parser!(u32).range(..=1000))]
    border: u32,
    /// How much a detector's probabilities of models count beside its masks when the dense fit compares models: 0 for
    /// nothing, 1 as if they were independent of the masks and honest
    #[arg(long, value_name = "WEIGHT", default_value_t = DenseOptions::default().model_weight, value_parser = weight)]
    model_weight: f64,
    /// With the dense fit, also fit measures of the best model (axles, hood, windscreen, rear window, belt) where it is one
    /// of those that come with the program: about a tenth of a second a vehicle. The results say them as `shape`
    #[arg(long)]
    fit_shape: bool,
    /// Seed of whatever is random
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ScalingFlag {
    Nearest,
    Bilinear,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FitFlag {
    Epnp,
    Sqpnp,
    Ransac,
    Dense,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum RankFlag {
    Error,
    Evidence,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Points2d {
    Cm,
    Rect,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Points3d {
    Cm,
    Cub,
    Visible,
}

/// The filters that are asked for: -SP, +WL, +BL, +CFIX.
#[derive(Clone, Copy, Debug)]
struct Filters([bool; 4]);

fn filters(text: &str) -> Result<Filters, String> {
    let mut chosen = [false; 4];
    if text != "none" {
        for name in text.split(',') {
            let at = ["sp", "wl", "bl", "cfix"].iter().position(|known| *known == name);
            let at = at.ok_or_else(|| {
                format!("`{name}` is not a filter: `none`, or some of sp,wl,bl,cfix, is meant")
            })?;
            chosen[at] = true;
        }
    }
    Ok(Filters(chosen))
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..1.0).contains(&value) => Ok(value),
        _ => Err("a share from 0 to 1 is meant, such as 0.005".to_owned()),
    }
}

fn weight(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=100.0).contains(&value) => Ok(value),
        _ => Err("a number from 0 to 100 is meant".to_owned()),
    }
}

impl PoseFlags {
    /// The options that the flags ask for.
    pub(crate) fn options(&self) -> PoseOptions {
        let Filters([small_parts, whitelist, blacklist, border]) = self.filters;
        PoseOptions {
            scaling: match self.scaling {
                ScalingFlag::Nearest => Scaling::Nearest,
                ScalingFlag::Bilinear => Scaling::Bilinear,
            },
            center_2d: match self.points_2d {
                Points2d::Cm => Center2d::Mass,
                Points2d::Rect => Center2d::Rectangle,
            },
            center_3d: match self.points_3d {
                Points3d::Cm => Center3d::Mass,
                Points3d::Cub => Center3d::Cuboid,
                Points3d::Visible => Center3d::Visible,
            },
            filters: PartFilters {
                small_parts: small_parts.then_some(self.small_part),
                whitelist,
                blacklist,
                image_border: border.then_some(self.border),
            },
            method: match self.fit {
                FitFlag::Epnp => PnpMethod::Epnp,
                FitFlag::Sqpnp => PnpMethod::Sqpnp,
                FitFlag::Ransac => PnpMethod::Ransac,
                FitFlag::Dense => PnpMethod::Dense,
            },
            ranking: match self.rank {
                RankFlag::Error => Ranking::Error,
                RankFlag::Evidence => Ranking::Evidence,
            },
            refine: self.refine,
            seed: self.seed,
            dense: DenseOptions {
                model_weight: self.model_weight,
                fit_shape: self.fit_shape,
                ..Default::default()
            },
        }
    }
}
