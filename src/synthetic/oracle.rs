//! [`Oracle`]: brute-force answers in f64, by arithmetic that shares nothing with the engine.
//!
//! In: a mesh as a list of corners with face ids, a plane frame, photos. Out: what a mosaic pixel shows, and
//! whether a photo sees it, by the definitions alone: every triangle is tried (Möller & Trumbore 1997, "Fast,
//! minimum storage ray/triangle intersection", doi:10.1080/10867651.1997.10487468), with no tree and no buffer.
//!
//! Each answer tells whether it is *clear*: whether it would be the same if every point were moved by up to the
//! slack. On rays along edges, two right programs may differ within rounding; there [`Oracle::accepts`] takes
//! every answer that is right within the slack, and no other.

use glam::{DVec2, DVec3};

use super::PlaneSpec;
use crate::camera::Photo;
use crate::geom::FaceId;

/// Brute-force answers for one mesh and one plane frame; see the module's page.
#[derive(Debug, Clone)]
pub struct Oracle {
    /// Corners relative to the frame's origin, exact to the last place whatever the size of ground coordinates.
    triangles: Vec<[DVec3; 3]>,
    ids: Vec<FaceId>,
    frame: PlaneSpec,
    slack_m: f64,
}

/// A face that a mosaic pixel's line of sight meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Elevation of the point, metres.
    pub elevation: f64,
    /// The face.
    pub face: FaceId,
    /// Ordinal of the triangle in the oracle's list.
    pub triangle: usize,
}

/// Whether a photo sees a point, and how sure that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// What decides.
    pub outcome: Outcome,
    /// Whether a yes stays a yes, and a no a no, if every point moves by up to the slack. Seldom false though it
    /// is so; never true where it is not.
    pub clear: bool,
}

/// What decides whether a photo sees a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// The photo sees it at this position, pixels.
    Seen(DVec2),
    /// It lies beside or behind the perspective centre.
    Behind,
    /// Its ray lies beyond the lens model's valid radius.
    BeyondRadius,
    /// It falls outside the frame.
    OutOfFrame,
    /// The perspective centre is on the other side of its face than the mosaic's viewer.
    WrongSide,
    /// This face stands in the way.
    Occluded(FaceId),
}

impl Outcome {
    /// Whether the photo sees the point.
    pub fn is_seen(self) -> bool {
        matches!(self, Self::Seen(_))
    }
}

/// Where a line meets a triangle's plane.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    /// Distance along the line's direction.
    t: f64,
    /// Distance inside the triangle from the nearest edge, across the line; negative outside. Metres.
    margin: f64,
    /// How much `t` may change if the points move by the slack.
    t_slack: f64,
}

impl Oracle {
    /// An oracle over `triangles` (ground frame, metres), of which `ids` names the faces.
    ///
    /// `slack_m` says how far points may be moved by the rounding of a right program; 1e-7 serves a façade.
    ///
    /// # Panics
    /// If there is not one id for each triangle.
    pub fn new(triangles: &[[DVec3; 3]], ids: &[FaceId], frame: PlaneSpec, slack_m: f64) -> Self {
        assert_eq!(triangles.len(), ids.len(), "one id a triangle");
        let triangles = triangles.iter().map(|t| t.map(|p| p - frame.origin)).collect();
        Self { triangles, ids: ids.to_vec(), frame, slack_m }
    }

    /// The frame.
    pub fn frame(&self) -> &PlaneSpec {
        &self.frame
    }

    /// The point at `elevation` over the centre of a mosaic pixel, ground frame, metres.
    pub fn ground(&self, [column, row]: [u32; 2], elevation: f64) -> DVec3 {
        self.frame.origin + self.relative([column, row], elevation)
    }

    /// What a mosaic pixel shows: of the triangles (closed, that is edges included) over its centre and within
    /// the slab, the one of greatest elevation; of equals, the one of lowest id. `None` if there is none.
    pub fn surface(&self, pixel: [u32; 2]) -> Option<Sight> {
        let [low, high] = self.frame.slab();
        let mut best: Option<Sight> = None;
        for (triangle, meeting) in self.over(self.relative(pixel, 0.0)) {
            if meeting.margin < 0.0 || meeting.t < low || meeting.t > high {
                continue;
            }
            let sight = Sight { elevation: meeting.t, face: self.ids[triangle], triangle };
            let wins = best.is_none_or(|b| {
                sight.elevation > b.elevation
                    || (sight.elevation.total_cmp(&b.elevation).is_eq() && sight.face < b.face)
            });
            if wins {
                best = Some(sight);
            }
        }
        // Twins are equal in truth, if not to the last place.
        best.map(|sight| {
            let triangle = self.earliest_twin(sight.triangle);
            Sight { face: self.ids[triangle], triangle, ..sight }
        })
    }

    /// Whether `claim`, an elevation and a face or nothing, is right for a pixel within the slack.
    ///
    /// Right is: the face may hold the pixel's centre, its elevation there is the claimed one within
    /// `tolerance_m`, and no place around the centre shows for sure a face nearer the viewer. Of faces with the same
    /// three corners only the lowest id is right. Nothing is right where some place around the centre shows nothing.
    pub fn accepts(&self, pixel: [u32; 2], claim: Option<(f64, FaceId)>, tolerance_m: f64) -> bool {
        let [low, high] = self.frame.slab();
        let floor = self.floor(pixel);
        let Some((elevation, face)) = claim else {
            return floor.is_infinite();
        };
        self.over(self.relative(pixel, 0.0)).filter(|&(k, _)| self.ids[k] == face).any(|(k, m)| {
            m.margin > -self.slack_m
                && (m.t - elevation).abs() <= tolerance_m + m.t_slack
                && m.t + m.t_slack >= floor
                && m.t + m.t_slack >= low
                && m.t - m.t_slack <= high
                && self.earliest_twin(k) == k
        })
    }

    /// The elevation that the nearest face has at least: the least, over eight places around the pixel's centre at
    /// the distance of the slack, of what is shown there. On an edge between two faces this is their elevation, so
    /// that a pin-hole is wrong; at a silhouette it is what lies below. Minus infinity if nothing may be shown.
    fn floor(&self, pixel: [u32; 2]) -> f64 {
        let [low, high] = self.frame.slab();
        let centre = self.relative(pixel, 0.0);
        let near = |m: &Meeting| m.margin > -3.0 * self.slack_m;
        let candidates: Vec<usize> =
            self.over(centre).filter(|(_, m)| near(m)).map(|(k, _)| k).collect();
        let highest = |from: DVec3| {
            let meetings = candidates.iter().filter_map(|&k| self.meet_above(from, k));
            meetings
                .filter(|m| m.margin >= 0.0 && m.t - m.t_slack > low && m.t + m.t_slack < high)
                .map(|m| m.t - m.t_slack)
                .fold(f64::NEG_INFINITY, f64::max)
        };
        around(self.frame.n())
            .map(|d| highest(centre + d * self.slack_m))
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether a photo sees the point at `sight.elevation` over a mosaic pixel, by DESIGN's rule: in front, within
    /// the valid radius, within the frame, the centre on the viewer's side of the face, and no other face before
    /// `distance − tolerance_m` from the centre.
    pub fn sees(&self, photo: &Photo, pixel: [u32; 2], sight: &Sight, tolerance_m: f64) -> Verdict {
        let point = self.relative(pixel, sight.elevation);
        let centre = photo.pose.centre_ground - self.frame.origin;
        let in_frame = self.in_frame(photo, point - centre);
        let Outcome::Seen(_) = in_frame.outcome else {
            return in_frame;
        };
        // The same side of the face as the viewer, who is infinitely far along n.
        let [a, b, c] = self.triangles[sight.triangle];
        let normal = (b - a).cross(c - a).normalize();
        let towards = normal * normal.dot(self.frame.n()).signum();
        let height = towards.dot(centre - a);
        // A turn of the normal by the slack over the face's own size moves the plane at the centre.
        let size = (b - a).length().min((c - b).length()).min((a - c).length());
        let side_clear = height.abs() > self.slack_m * (1.0 + (centre - a).length() / size);
        if height <= 0.0 {
            return Verdict { outcome: Outcome::WrongSide, clear: side_clear };
        }
        let clear = in_frame.clear && side_clear;
        let (occluder, sure) = self.occluder([centre, point], sight.face, tolerance_m);
        match occluder {
            Some(face) => Verdict { outcome: Outcome::Occluded(face), clear: sure },
            None => Verdict { outcome: in_frame.outcome, clear: clear && sure },
        }
    }

    /// All triangles whose plane the line of sight through a point of the frame's plane meets, with the elevation
    /// there.
    fn over(&self, from: DVec3) -> impl Iterator<Item = (usize, Meeting)> + '_ {
        (0..self.triangles.len()).filter_map(move |k| Some((k, self.meet_above(from, k)?)))
    }

    /// Where the line of sight through a point of the frame's plane meets a triangle.
    fn meet_above(&self, from: DVec3, k: usize) -> Option<Meeting> {
        let (triangle, along) = (&self.triangles[k], self.frame.n());
        let mut meeting = meet(from, along, triangle, self.slack_m)?;
        // Within the vertices' range: an almost edge-on face must not shoot beyond itself.
        let [a, b, c] = triangle.map(|p| p.dot(along));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        meeting.t = meeting.t.clamp(low, high);
        meeting.t_slack = meeting.t_slack.min(high - low + self.slack_m);
        Some(meeting)
    }

    /// A point relative to the frame's origin.
    fn relative(&self, [column, row]: [u32; 2], elevation: f64) -> DVec3 {
        let at =
            self.frame.plane_from_pixel(DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5));
        self.frame.u_axis * at.x + self.frame.v_axis * at.y + self.frame.n() * elevation
    }

    /// The triangle of lowest id with the same corners, in any order.
    fn earliest_twin(&self, k: usize) -> usize {
        let own = &self.triangles[k];
        let is_twin =
            |t: &[DVec3; 3]| t.iter().all(|p| own.contains(p)) && own.iter().all(|p| t.contains(p));
        let twins = (0..self.triangles.len()).filter(|&j| is_twin(&self.triangles[j]));
        twins.min_by_key(|&j| self.ids[j]).unwrap_or(k)
    }

    /// The tests that look at the photo alone; `offset` is the point less the perspective centre.
    fn in_frame(&self, photo: &Photo, offset: DVec3) -> Verdict {
        let camera = photo.pose.rotation * offset;
        if camera.z <= 0.0 {
            return Verdict { outcome: Outcome::Behind, clear: camera.z < -self.slack_m };
        }
        let ray = camera.truncate() / camera.z;
        let ray_slack = self.slack_m / camera.z * (1.0 + ray.length());
        let front_clear = camera.z > self.slack_m;
        let radius_room = photo.lens.valid_radius() - ray.length();
        let Some(position) = photo.lens.photo_from_ray(ray) else {
            let clear = front_clear && radius_room < -ray_slack;
            return Verdict { outcome: Outcome::BeyondRadius, clear };
        };
        let size = photo.lens.size();
        let extent = DVec2::new(f64::from(size.width), f64::from(size.height));
        let room = position.min(extent - position).min_element();
        // No lens magnifies a ray's change by more than a few times its focal length.
        let clear = front_clear
            && radius_room > ray_slack
            && room.abs() > 4.0 * ray_slack * photo.lens.focal_px().max_element();
        let inside = photo.lens.contains(position);
        Verdict {
            outcome: if inside { Outcome::Seen(position) } else { Outcome::OutOfFrame },
            clear,
        }
    }

    /// A face other than `own` that cuts the segment, and whether the answer is the same for all lines around it.
    fn occluder(
        &self,
        [from, to]: [DVec3; 2],
        own: FaceId,
        tolerance_m: f64,
    ) -> (Option<FaceId>, bool) {
        let length = (to - from).length();
        let along = (to - from) / length;
        // How far inside the shortened segment the meeting is.
        let room = |m: &Meeting| m.t.min(length - tolerance_m - m.t);
        let mut candidates = Vec::new();
        let mut found = None;
        for (k, triangle) in self.triangles.iter().enumerate().filter(|&(k, _)| self.ids[k] != own)
        {
            let Some(m) = meet(from, along, triangle, self.slack_m) else { continue };
            if m.margin > -3.0 * self.slack_m && room(&m) > -3.0 * m.t_slack {
                candidates.push(triangle);
            }
            if m.margin >= 0.0 && room(&m) > 0.0 {
                found = Some(self.ids[k]);
            }
        }
        // What is cut with this much room to spare; less than none for what is not to be cut at all.
        let side = if found.is_some() { 1.0 } else { -1.0 };
        let is_cut = |offset: DVec3| {
            let from = from + offset * self.slack_m;
            let meetings = candidates.iter().filter_map(|t| meet(from, along, t, self.slack_m));
            meetings.into_iter().any(|m| m.margin >= 0.0 && room(&m) > side * m.t_slack)
        };
        let sure = around(along).all(|offset| is_cut(offset) == found.is_some());
        (found, sure)
    }
}

/// Eight unit vectors square to `along`, evenly around it.
fn around(along: DVec3) -> impl Iterator<Item = DVec3> {
    let (one, two) = along.any_orthonormal_pair();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turns = [(1.0, 0.0), (half, half), (0.0, 1.0), (-half, half)];
    turns.into_iter().flat_map(move |(c, s)| [one * c + two * s, -(one * c + two * s)])
}

/// Where the line `from + t · along` (a unit vector) meets a triangle's plane; `None` if it is parallel to it.
fn meet(from: DVec3, along: DVec3, [a, b, c]: &[DVec3; 3], slack_m: f64) -> Option<Meeting> {
    let (e1, e2) = (b - a, c - a);
    let p = along.cross(e2);
    // Twice the area as seen along the line.
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = from - a;
    let q = s.cross(e1);
    let (v, w) = (s.dot(p) / det, along.dot(q) / det);
    let weights = [1.0 - v - w, v, w];
    let edges = [c - b, e2, e1];
    // A weight times the triangle's height over that edge, both as seen along the line.
    let margin = |k: usize| weights[k] * det.abs() / edges[k].cross(along).length();
    let slope = e1.cross(e2).length() / det.abs();
    Some(Meeting {
        t: e2.dot(q) / det,
        margin: margin(0).min(margin(1)).min(margin(2)),
        t_slack: slack_m * (1.0 + slope),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{LensModel, PhotoId};
    use crate::geom::Size;
    use crate::synthetic::{CameraSpec, Placement, Shot};

    /// A square of two metres at `height`, and a frame of 1 cm pixels over it.
    fn square(height: f64, half: f64) -> [[DVec3; 3]; 2] {
        let p = |x: f64, y: f64| DVec3::new(x * half, y * half, height);
        [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]]
    }

    fn frame() -> PlaneSpec {
        PlaneSpec::of_scene(&Placement::IDENTITY, 0.01, [-1.5, -1.5, 1.5, 1.5])
    }

    fn oracle(triangles: &[[DVec3; 3]], frame: PlaneSpec) -> Oracle {
        let ids: Vec<FaceId> = (0..).take(triangles.len()).map(FaceId).collect();
        Oracle::new(triangles, &ids, frame, 1e-7)
    }

    /// Pixel (150, y) has its centre at x = 0.005.
    const MIDDLE: [u32; 2] = [150, 120];

    #[test]
    fn the_greatest_elevation_wins_and_of_equals_the_lowest_id() {
        let triangles = [square(0.0, 1.0), square(0.5, 0.5), square(0.5, 0.5)].concat();
        let o = oracle(&triangles, frame());
        let sight = o.surface(MIDDLE).unwrap();
        assert!((sight.elevation - 0.5).abs() < 1e-12);
        assert_eq!(sight.face, FaceId(3));
        assert!(o.accepts(MIDDLE, Some((0.5, FaceId(3))), 1e-9));
        assert!(!o.accepts(MIDDLE, Some((0.5, FaceId(5))), 1e-9), "a twin of higher id");
        assert!(!o.accepts(MIDDLE, Some((0.0, FaceId(1))), 1e-9), "a face below");
        assert!(!o.accepts(MIDDLE, Some((0.4, FaceId(3))), 1e-9), "a wrong elevation");
        assert!(!o.accepts(MIDDLE, None, 1e-9));
        assert_eq!(o.surface([2, 2]), None);
        assert!(o.accepts([2, 2], None, 1e-9));
        assert!(!o.accepts([2, 2], Some((0.0, FaceId(0))), 1e-9));
    }

    #[test]
    fn a_slab_clips_points_not_faces() {
        let tilted = [[
            DVec3::new(-1.0, -1.0, -1.0),
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(0.0, 1.0, 1.0),
        ]];
        let mut frame = frame();
        frame.elevation = Some([-0.5, 0.5]);
        let o = oracle(&tilted, frame);
        // Elevation equals y on the face.
        let shown = |row: u32| o.surface([150, row]).map(|s| s.elevation);
        assert_eq!(shown(90), None);
        assert!((shown(150).unwrap() + 0.005).abs() < 1e-12);
        assert_eq!(shown(210), None);
        assert!(o.accepts([150, 90], None, 1e-9) && !o.accepts([150, 150], None, 1e-9));
    }

    #[test]
    fn on_an_edge_either_face_is_accepted_but_no_third() {
        let mut triangles = square(0.0, 1.0).to_vec();
        triangles.extend(square(-0.3, 1.2));
        let mut frame = frame();
        // Pixel centres on the square's diagonal.
        frame.extent = [-1.505, -1.5, 1.495, 1.5];
        frame.extent[1] -= 0.005;
        frame.extent[3] -= 0.005;
        let o = oracle(&triangles, frame);
        let at = o.ground([150, 149], 0.0);
        assert!((at.x - at.y).abs() < 1e-12);
        for (face, right) in [(0, true), (1, true), (2, false), (3, false)] {
            let claim = Some((if face < 2 { 0.0 } else { -0.3 }, FaceId(face)));
            assert_eq!(o.accepts([150, 149], claim, 1e-9), right, "{face}");
        }
    }

    fn photo(centre: DVec3) -> Photo {
        let camera = CameraSpec {
            model: LensModel::Pinhole,
            size: Size::new(400, 300),
            params: vec![300.0, 300.0, 200.0, 150.0],
        };
        let ends = [centre, DVec3::new(0.0, 0.0, centre.z - 2.0)];
        Shot::towards("a", &camera, &Placement::IDENTITY, ends, 0.0).photo(PhotoId(0)).unwrap()
    }

    #[test]
    fn each_reason_not_to_see_is_named() {
        let triangles = [square(0.0, 1.0), square(1.0, 0.1)].concat();
        let o = oracle(&triangles, frame());
        // Row 100: y = 0.495, the ground square, beside the small one.
        let pixel = [150, 100];
        let sight = o.surface(pixel).unwrap();
        assert!(sight.elevation.abs() < 1e-12);
        let see = |centre: DVec3| o.sees(&photo(centre), pixel, &sight, 2e-4);
        let seen = see(DVec3::new(0.01, 0.02, 2.0));
        assert!(seen.outcome.is_seen() && seen.clear, "{seen:?}");
        // From (0.005, −0.485, 2) the line passes the small square at its height, (0.005, 0.005, 1).
        let hidden = see(DVec3::new(0.005, -0.485, 2.0));
        assert!(matches!(hidden.outcome, Outcome::Occluded(FaceId(2 | 3))), "{hidden:?}");
        let side = see(DVec3::new(0.3, 0.2, -2.0));
        assert_eq!(side, Verdict { outcome: Outcome::Behind, clear: true });
        let outside = see(DVec3::new(0.0, -3.0, 0.3));
        assert_eq!(outside, Verdict { outcome: Outcome::OutOfFrame, clear: true });
    }

    #[test]
    fn from_below_a_face_is_on_the_wrong_side_whatever_its_winding() {
        for winding in [false, true] {
            let mut triangles = square(0.0, 1.0);
            if winding {
                triangles = triangles.map(|[a, b, c]| [c, b, a]);
            }
            let o = oracle(&triangles, frame());
            let sight = o.surface(MIDDLE).unwrap();
            let camera = photo(DVec3::new(0.1, 0.1, 2.0));
            assert!(o.sees(&camera, MIDDLE, &sight, 2e-4).outcome.is_seen());
            // The same camera below, looking up.
            let mut below = camera.clone();
            below.pose.centre_ground.z = -2.0;
            below.pose.rotation.z_axis *= -1.0;
            let verdict = o.sees(&below, MIDDLE, &sight, 2e-4);
            assert_eq!(verdict, Verdict { outcome: Outcome::WrongSide, clear: true });
        }
    }

    #[test]
    fn a_sight_line_through_an_edge_between_two_faces_is_hidden_for_sure() {
        // The diagonal x = y of the small square; the line passes it at (0.01, 0.01, 1).
        let triangles = [square(0.0, 1.0), square(1.0, 0.1)].concat();
        let o = oracle(&triangles, frame());
        let pixel = [170, 109];
        let sight = o.surface(pixel).unwrap();
        let p = o.ground(pixel, 0.0);
        let centre = DVec3::new(0.02 - p.x, 0.02 - p.y, 2.0);
        let verdict = o.sees(&photo(centre), pixel, &sight, 2e-4);
        assert!(matches!(verdict.outcome, Outcome::Occluded(_)) && verdict.clear, "{verdict:?}");
        // Through its outer edge, x = 0.1, the answer hangs on rounding.
        let centre = DVec3::new(0.2 - p.x, 0.02 - p.y, 2.0);
        assert!(!o.sees(&photo(centre), pixel, &sight, 2e-4).clear);
    }

    #[test]
    fn a_face_nearer_than_the_tolerance_to_the_point_does_not_hide_it() {
        let triangles = [square(0.0, 1.0), square(0.01, 0.9)].concat();
        let mut frame = frame();
        frame.elevation = Some([-0.005, 0.005]);
        let o = oracle(&triangles, frame);
        let sight = o.surface(MIDDLE).unwrap();
        let camera = photo(DVec3::new(0.005, 0.2, 2.0));
        assert!(!o.sees(&camera, MIDDLE, &sight, 0.005).outcome.is_seen());
        assert!(o.sees(&camera, MIDDLE, &sight, 0.02).outcome.is_seen());
    }
}
