//! Fused positions as `foxglove.LocationFix`, which Foxglove and Rerun show on a map: a message of Protocol Buffers with its own description.

use cofix_common::filter::PhoneState;
use cofix_common::frames::LocalFrame;
use cofix_common::time::GpsTime;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet, Timestamp,
};

/// Name of the schema.
pub(super) const SCHEMA: &str = "foxglove.LocationFix";
/// Encoding of schema and messages.
pub(super) const ENCODING: &str = "protobuf";

/// A position on the Earth.
#[derive(Clone, PartialEq, prost::Message)]
pub struct LocationFix {
    /// Latitude, degrees.
    #[prost(double, tag = "1")]
    pub latitude: f64,
    /// Longitude, degrees.
    #[prost(double, tag = "2")]
    pub longitude: f64,
    /// Height above the ellipsoid, m.
    #[prost(double, tag = "3")]
    pub altitude: f64,
    /// Covariance, row by row: east, north, up; m².
    #[prost(double, repeated, tag = "4")]
    pub position_covariance: Vec<f64>,
    /// What is known of the covariance.
    #[prost(enumeration = "CovarianceType", tag = "5")]
    pub position_covariance_type: i32,
    /// Time of the position. GPS time is shown as if it were UTC, as in recordings.
    #[prost(message, optional, tag = "6")]
    pub timestamp: Option<Timestamp>,
    /// The phone.
    #[prost(string, tag = "7")]
    pub frame_id: String,
}

/// What is known of a covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum CovarianceType {
    /// Nothing.
    Unknown = 0,
    /// About how large it is.
    Approximated = 1,
    /// Its diagonal.
    DiagonalKnown = 2,
    /// All.
    Known = 3,
}

impl LocationFix {
    /// Of a phone's fused state.
    pub fn of(time_gps: GpsTime, phone: &str, state: &PhoneState) -> Self {
        let position = state.position();
        let geodetic = position.ecef_to_geodetic();
        let covariance = state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let enu_m2 = LocalFrame::at(position).covariance_ecef_to_enu(&covariance);
        Self {
            latitude: geodetic.latitude_deg(),
            longitude: geodetic.longitude_deg(),
            altitude: geodetic.height_m,
            // Columns of the transpose are rows.
            position_covariance: enu_m2.transpose().iter().copied().collect(),
            position_covariance_type: CovarianceType::Known.into(),
            timestamp: Some(timestamp(time_gps)),
            frame_id: phone.to_owned(),
        }
    }
}

fn timestamp(time_gps: GpsTime) -> Timestamp {
    const NANOS_PER_SECOND: i64 = 1_000_000_000;
    let nanos = time_gps.as_unix_calendar_nanos();
    Timestamp {
        seconds: nanos.div_euclid(NANOS_PER_SECOND),
        nanos: i32::try_from(nanos.rem_euclid(NANOS_PER_SECOND)).unwrap_or_default(),
    }
}

/// The description of [`LocationFix`] and of what it is made of.
pub(super) fn descriptors() -> FileDescriptorSet {
    const TIMESTAMP: &str = "google/protobuf/timestamp.proto";
    let of_timestamp = DescriptorProto {
        name: Some("Timestamp".to_owned()),
        field: vec![field("seconds", 1, Type::Int64, ""), field("nanos", 2, Type::Int32, "")],
        ..DescriptorProto::default()
    };
    let of_fix = DescriptorProto {
        name: Some("LocationFix".to_owned()),
        field: vec![
            field("latitude", 1, Type::Double, ""),
            field("longitude", 2, Type::Double, ""),
            field("altitude", 3, Type::Double, ""),
            FieldDescriptorProto {
                label: Some(Label::Repeated.into()),
                ..field("position_covariance", 4, Type::Double, "")
            },
            field("position_covariance_type", 5, Type::Enum, ".foxglove.LocationFix.PositionCovarianceType"),
            field("timestamp", 6, Type::Message, ".google.protobuf.Timestamp"),
            field("frame_id", 7, Type::String, ""),
        ],
        enum_type: vec![of_covariance_type()],
        ..DescriptorProto::default()
    };
    FileDescriptorSet {
        file: vec![
            file(TIMESTAMP, "google.protobuf", &[], of_timestamp),
            file("foxglove/LocationFix.proto", "foxglove", &[TIMESTAMP], of_fix),
        ],
    }
}

fn of_covariance_type() -> EnumDescriptorProto {
    let types = [
        ("UNKNOWN", CovarianceType::Unknown),
        ("APPROXIMATED", CovarianceType::Approximated),
        ("DIAGONAL_KNOWN", CovarianceType::DiagonalKnown),
        ("KNOWN", CovarianceType::Known),
    ];
    let value = types.map(|(name, number)| EnumValueDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number.into()),
        options: None,
    });
    EnumDescriptorProto {
        name: Some("PositionCovarianceType".to_owned()),
        value: value.to_vec(),
        ..EnumDescriptorProto::default()
    }
}

fn file(name: &str, package: &str, needed: &[&str], message: DescriptorProto) -> FileDescriptorProto {
    FileDescriptorProto {
        name: Some(name.to_owned()),
        package: Some(package.to_owned()),
        dependency: needed.iter().map(|&name| name.to_owned()).collect(),
        message_type: vec![message],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    }
}

/// `type_name` is that of a message or an enumeration; empty for numbers and text.
fn field(name: &str, number: i32, kind: Type, type_name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        type_name: (!type_name.is_empty()).then(|| type_name.to_owned()),
        ..FieldDescriptorProto::default()
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::frames::{Ecef, Enu, Geodetic};
    use nalgebra::{SMatrix, SVector};
    use prost::Message;
    use prost_reflect::{DescriptorPool, DynamicMessage, Value};

    use super::*;

    /// A phone's state with a standard deviation of 1 m to the east, 2 m to the north, 3 m upwards.
    fn state(position: Ecef) -> PhoneState {
        let mut state = PhoneState { mean: SVector::zeros(), covariance: SMatrix::identity() };
        state.mean.fixed_rows_mut::<3>(0).copy_from(&position.0);
        let frame = LocalFrame::at(position);
        let enu = |east, north, up| Enu { east, north, up };
        let axes = [enu(1.0, 0.0, 0.0), enu(0.0, 2.0, 0.0), enu(0.0, 0.0, 3.0)];
        let covariance = axes.map(|axis| frame.vector_enu_to_ecef(axis).0).map(|v| v * v.transpose());
        state.covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance.iter().sum());
        state
    }

    /// Whoever knows the description alone reads all there is.
    #[test]
    fn a_fix_is_read_by_its_description() {
        let position = Geodetic::from_degrees(47.5, -122.25, 12.0).geodetic_to_ecef();
        let time_gps = GpsTime::from_week_tow(2_118, 397_000.5);
        let bytes = LocationFix::of(time_gps, "pixel", &state(position)).encode_to_vec();
        let pool = DescriptorPool::decode(descriptors().encode_to_vec().as_slice()).unwrap();
        let message =
            DynamicMessage::decode(pool.get_message_by_name(SCHEMA).unwrap(), bytes.as_slice()).unwrap();
        assert_eq!(message.unknown_fields().count(), 0);
        let field = |name: &str| message.get_field_by_name(name).unwrap().into_owned();
        let number = |name: &str| field(name).as_f64().unwrap();
        assert!((number("latitude") - 47.5).abs() < 1e-9 && (number("longitude") + 122.25).abs() < 1e-9);
        assert!((number("altitude") - 12.0).abs() < 1e-5);
        assert_eq!(field("frame_id").as_str(), Some("pixel"));
        assert_eq!(field("position_covariance_type").as_enum_number(), Some(3));
        let covariance = field("position_covariance");
        let covariance: Vec<f64> = covariance.as_list().unwrap().iter().filter_map(Value::as_f64).collect();
        for (found, expected) in covariance.iter().zip([1.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0]) {
            assert!((found - expected).abs() < 1e-9, "{covariance:?}");
        }
        assert_eq!(covariance.len(), 9);
        let timestamp = field("timestamp");
        let part = |name: &str| timestamp.as_message().unwrap().get_field_by_name(name).unwrap().into_owned();
        let nanos =
            i64::from(part("nanos").as_i32().unwrap()) + 1_000_000_000 * part("seconds").as_i64().unwrap();
        assert_eq!(nanos, time_gps.as_unix_calendar_nanos());
    }
}
