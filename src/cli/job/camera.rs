//! [`CameraRecord`]: a photo's orientation, to the last bit.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::camera::{Lens, LensModel, Pose};
use crate::geom::Size;

/// Interior and exterior orientation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct CameraRecord {
    model: String,
    width: u32,
    height: u32,
    params: Vec<f64>,
    /// `camera_from_ground`, column by column.
    rotation: [f64; 9],
    /// Ground, metres.
    centre: [f64; 3],
}

impl CameraRecord {
    pub(in crate::cli) fn new(lens: &Lens, pose: &Pose) -> Self {
        let size = lens.size();
        Self {
            model: lens.model().name().into(),
            width: size.width,
            height: size.height,
            params: lens.params().to_vec(),
            rotation: pose.rotation.to_cols_array(),
            centre: pose.centre_ground.to_array(),
        }
    }

    /// The orientation; what is wrong with it if there is none.
    pub(in crate::cli) fn read(&self) -> Result<(Lens, Pose), String> {
        let model = LensModel::from_any_name(&self.model);
        let model = model.ok_or_else(|| format!("camera model {:?}", self.model))?;
        let lens = Lens::new(model, Size::new(self.width, self.height), &self.params);
        let numbers = self.rotation.iter().chain(&self.centre);
        if numbers.clone().any(|n| !n.is_finite()) {
            return Err("a pose that is not finite".into());
        }
        let rotation = DMat3::from_cols_array(&self.rotation);
        let pose = Pose { rotation, centre_ground: DVec3::from_array(self.centre) };
        Ok((lens.map_err(|e| e.to_string())?, pose))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_reads_back_to_the_same_bits_by_way_of_text() {
        let quaternion = [0.3, -0.7, 0.2, 0.611];
        let pose = Pose::from_colmap(quaternion, DVec3::new(0.1, -1e5 / 3.0, 7.7)).unwrap();
        let models = (0..64).filter_map(LensModel::from_id);
        let own = ["BROWN", "BROWN_FISHEYE", "BROWN_OFF_CENTRE"];
        let own = own.into_iter().filter_map(LensModel::from_any_name);
        let mut count = 0;
        for model in models.chain(own).filter(|model| model.is_supported()) {
            let mut params = vec![0.012_345_6 / 7.0; model.param_count()];
            params[..2].fill(1234.567);
            let Ok(lens) = Lens::new(model, Size::new(800, 600), &params) else {
                panic!("{model:?}")
            };
            for lens in [lens, lens.without_distortion()] {
                let text = serde_json::to_string(&CameraRecord::new(&lens, &pose)).unwrap();
                let back: CameraRecord = serde_json::from_str(&text).unwrap();
                assert_eq!(back.read(), Ok((lens, pose)), "{model:?}");
            }
            count += 1;
        }
        assert!(count >= 16, "{count}");
        let mut bad = CameraRecord::new(
            &Lens::new(LensModel::Pinhole, Size::new(8, 6), &[9.0, 9.0, 4.0, 3.0]).unwrap(),
            &pose,
        );
        bad.centre[1] = f64::NAN;
        assert!(bad.read().is_err());
        bad.model = "PINHOLY".into();
        assert!(bad.read().unwrap_err().contains("PINHOLY"));
    }
}
