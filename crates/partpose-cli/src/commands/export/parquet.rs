//! One Parquet table, one row a vehicle with a pose: for pandas, polars, `DuckDB`, Spark, Daft; and such a table read.

mod read;

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use partpose::files;
use partpose::formats::{PosedImage, PosedVehicle};
use partpose::geometry::EulerAngles;

pub(super) use read::read;

/// The file that is written.
const FILE: &str = "vehicles.parquet";
/// Rows that are written at once.
const GROUP: usize = 100_000;

/// A row of the table.
struct Row<'a> {
    number: usize,
    image: &'a PosedImage,
    vehicle: &'a PosedVehicle,
}

/// What a column holds.
enum Column {
    Text(fn(&Row) -> String),
    Whole(fn(&Row) -> i64),
    Number(fn(&Row) -> f64),
    /// Not in every row.
    MaybeWhole(fn(&Row) -> Option<i64>),
    MaybeNumber(fn(&Row) -> Option<f64>),
}

use Column::{MaybeNumber, MaybeWhole, Number, Text, Whole};

const COLUMNS: [(&str, Column); 36] = [
    ("image", Text(|r| r.image.image.clone())),
    ("image_index", Whole(|r| r.number as i64)),
    ("width_px", Whole(|r| i64::from(r.image.camera.size[0]))),
    ("height_px", Whole(|r| i64::from(r.image.camera.size[1]))),
    ("fx", Number(|r| r.image.camera.focal[0])),
    ("fy", Number(|r| r.image.camera.focal[1])),
    ("cx", Number(|r| r.image.camera.principal_point[0])),
    ("cy", Number(|r| r.image.camera.principal_point[1])),
    ("model", Text(|r| r.vehicle.model.clone())),
    ("category", Text(|r| r.vehicle.category.clone())),
    ("score", Number(|r| r.vehicle.score)),
    ("confidence", MaybeNumber(|r| r.vehicle.confidence)),
    ("reprojection_rmse", MaybeNumber(|r| r.vehicle.reprojection_rmse)),
    ("x_min", Number(|r| r.vehicle.bounds.x_min)),
    ("y_min", Number(|r| r.vehicle.bounds.y_min)),
    ("x_max", Number(|r| r.vehicle.bounds.x_max)),
    ("y_max", Number(|r| r.vehicle.bounds.y_max)),
    ("x", Number(|r| place(r, 0))),
    ("y", Number(|r| place(r, 1))),
    ("z", Number(|r| place(r, 2))),
    ("r00", Number(|r| rotation(r, 0))),
    ("r01", Number(|r| rotation(r, 1))),
    ("r02", Number(|r| rotation(r, 2))),
    ("r10", Number(|r| rotation(r, 3))),
    ("r11", Number(|r| rotation(r, 4))),
    ("r12", Number(|r| rotation(r, 5))),
    ("r20", Number(|r| rotation(r, 6))),
    ("r21", Number(|r| rotation(r, 7))),
    ("r22", Number(|r| rotation(r, 8))),
    ("pitch", Number(|r| angles(r).x)),
    ("yaw", Number(|r| angles(r).y)),
    ("roll", Number(|r| angles(r).z)),
    ("width", Number(|r| r.vehicle.cuboid.extent.width)),
    ("height", Number(|r| r.vehicle.cuboid.extent.height)),
    ("length", Number(|r| r.vehicle.cuboid.extent.length)),
    ("track", MaybeWhole(|r| r.vehicle.track.as_ref().map(|track| i64::from(track.id)))),
];

fn place(row: &Row, axis: usize) -> f64 {
    row.vehicle.cuboid.camera_from_vehicle.translation.vector[axis]
}

fn rotation(row: &Row, at: usize) -> f64 {
    row.vehicle.cuboid.camera_from_vehicle.rotation.to_rotation_matrix()[(at / 3, at % 3)]
}

fn angles(row: &Row) -> EulerAngles {
    EulerAngles::from_rotation(
        &row.vehicle.cuboid.camera_from_vehicle.rotation.to_rotation_matrix(),
    )
}

/// Writes the table.
pub(super) fn write(out: &Path, images: &[PosedImage]) -> anyhow::Result<()> {
    let bytes = encode(images).context("the results cannot be written as Parquet")?;
    Ok(files::write(&out.join(FILE), &bytes)?)
}

fn encode(images: &[PosedImage]) -> anyhow::Result<Vec<u8>> {
    let rows: Vec<Row> = images
        .iter()
        .enumerate()
        .flat_map(|(number, image)| {
            image.vehicles.iter().map(move |vehicle| Row { number, image, vehicle })
        })
        .collect();
    let field = |(name, column): &(&str, Column)| match column {
        Text(_) => format!("REQUIRED BYTE_ARRAY {name} (STRING);"),
        Whole(_) => format!("REQUIRED INT64 {name};"),
        Number(_) => format!("REQUIRED DOUBLE {name};"),
        MaybeWhole(_) => format!("OPTIONAL INT64 {name};"),
        MaybeNumber(_) => format!("OPTIONAL DOUBLE {name};"),
    };
    let fields: String = COLUMNS.iter().map(field).collect();
    let schema = Arc::new(parse_message_type(&format!("message vehicles {{ {fields} }}"))?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(concat!("partpose ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    for rows in rows.chunks(GROUP) {
        let mut group = file.next_row_group()?;
        for (_, column) in &COLUMNS {
            let mut writer = group.next_column()?.context("a column is missing")?;
            match column {
                Text(of) => {
                    let values: Vec<ByteArray> =
                        rows.iter().map(|row| ByteArray::from(of(row).into_bytes())).collect();
                    writer.typed::<ByteArrayType>().write_batch(&values, None, None)?;
                }
                Whole(of) => {
                    let values: Vec<i64> = rows.iter().map(of).collect();
                    writer.typed::<Int64Type>().write_batch(&values, None, None)?;
                }
                Number(of) => {
                    let values: Vec<f64> = rows.iter().map(of).collect();
                    writer.typed::<DoubleType>().write_batch(&values, None, None)?;
                }
                MaybeWhole(of) => {
                    let (values, levels) = present(rows, *of);
                    writer.typed::<Int64Type>().write_batch(&values, Some(&levels), None)?;
                }
                MaybeNumber(of) => {
                    let (values, levels) = present(rows, *of);
                    writer.typed::<DoubleType>().write_batch(&values, Some(&levels), None)?;
                }
            }
            writer.close()?;
        }
        group.close()?;
    }
    file.close()?;
    Ok(bytes)
}

/// The values that are there, and for each row 1 where it has one, else 0.
fn present<T>(rows: &[Row], of: fn(&Row) -> Option<T>) -> (Vec<T>, Vec<i16>) {
    let values: Vec<Option<T>> = rows.iter().map(of).collect();
    let levels = values.iter().map(|value| i16::from(value.is_some())).collect();
    (values.into_iter().flatten().collect(), levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use partpose::formats::{PosedTrack, PosedVehicle};
    use partpose::geometry::{Camera, Cuboid, Extent, Pose, Rect};

    fn vehicle() -> PosedVehicle {
        PosedVehicle {
            model: "sedan".to_owned(),
            category: "Car".to_owned(),
            bounds: Rect::new(0.0, 1.0, 9.0, 10.0),
            score: 0.75,
            cuboid: Cuboid {
                camera_from_vehicle: Pose::translation(1.0, 1.5, 20.0),
                extent: Extent::new(1.8, 1.5, 4.4),
            },
            confidence: Some(0.5),
            covariance: None,
            reprojection_rmse: None,
            track: None,
        }
    }

    #[test]
    fn every_vehicle_is_a_row() {
        let vehicle = vehicle();
        let cuboid = vehicle.cuboid;
        let track = PosedTrack { id: 7, model: "van".to_owned(), cuboid, covariance: None };
        let followed = PosedVehicle { track: Some(track), ..vehicle.clone() };
        let camera = Camera::pinhole(700.0, [600.0, 180.0], [1242, 375]);
        let image = |name: &str, vehicles: Vec<PosedVehicle>| PosedImage {
            image: name.to_owned(),
            camera,
            vehicles,
        };
        let images = [
            image("a.png", vec![vehicle]),
            image("b.png", Vec::new()),
            image("c.png", vec![followed]),
        ];
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &images).unwrap();
        let bytes = std::fs::File::open(folder.path().join(FILE)).unwrap();
        let file = SerializedFileReader::new(bytes).unwrap();
        let rows: Vec<String> =
            file.get_row_iter(None).unwrap().map(|row| row.unwrap().to_string()).collect();
        assert_eq!(rows.len(), 2);
        assert!(
            rows[0].contains("image: \"a.png\"") && rows[0].contains("track: null"),
            "{}",
            rows[0]
        );
        assert!(rows[1].contains("image_index: 2") && rows[1].contains("track: 7"), "{}", rows[1]);
        assert!(encode(&[]).is_ok());
        let back = super::read(&folder.path().join(FILE)).unwrap();
        let names: Vec<&str> = back.iter().map(|image| image.image.as_str()).collect();
        assert_eq!(names, ["a.png", "c.png"], "an image without vehicles has no row");
        let (read, wrote) = (&back[0].vehicles[0], &images[0].vehicles[0]);
        assert_eq!((back[0].camera, read.bounds), (camera, wrote.bounds));
        assert_eq!((read.score, read.confidence), (wrote.score, wrote.confidence));
        assert_eq!((&read.model, &read.category), (&wrote.model, &wrote.category));
        assert!(read.cuboid.iou(&cuboid) > 1.0 - 1e-9);
        assert_eq!(back[1].vehicles[0].track.as_ref().map(|track| track.id), Some(7));
    }

    #[test]
    fn a_table_that_is_damaged_or_another_is_refused() {
        let vehicle = vehicle();
        let camera = Camera::pinhole(700.0, [600.0, 180.0], [1242, 375]);
        let image = PosedImage { image: "a.png".to_owned(), camera, vehicles: vec![vehicle; 3] };
        let bytes = encode(&[image]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let said = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            super::read(&path).map_err(|error| format!("{error:#}"))
        };
        assert_eq!(said(&bytes).unwrap()[0].vehicles.len(), 3);
        for cut in [0, 3, 8, bytes.len() / 2, bytes.len() - 1] {
            let said = said(&bytes[..cut]).unwrap_err();
            assert!(said.contains("cannot be read as Parquet"), "{said}");
        }
        // Whatever a damaged file holds: an answer or an error.
        for at in (0..bytes.len()).step_by(7) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 0xff;
            let _ = said(&bytes);
        }
    }
}
