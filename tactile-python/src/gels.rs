//! Gel sensors, and markers printed on gels, from arrays.
use crate::arrays::{self, kept};
use crate::errors::{self, TactileError, invalid};
use crate::results::{Estimate, GelContact, GelFrame, GelReport, Markers, of_values};
use ndarray::{Array2, s};
use pyo3::prelude::*;
use pyo3::types::PyType;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use tactile_files::io::Grey;
use tactile_files::sensor::{CalibratedGel, GelFile, GelPixels, GelPresses};
use tactile_imaging::core::Estimate as CoreEstimate;
use tactile_imaging::gel::{
    BallPress, CalibrationReport, DarkModel, FrameDoubt, GaugeForce, GelError, GelFrame as Frame,
    GelImage, GelLaw, GelLayer, GelMarkers, GelSensor as Gel, GelWrench, MarkerSlip, find_markers,
    track_markers,
};
use tactile_imaging::matching::MatchError;

/// A gel sensor, lit in colours or darkening: from frames to surface, contacts and forces.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct GelSensor {
    gel: CalibratedGel,
    law: Option<GelLaw>,
    order: Order,
    report: Option<Py<GelReport>>,
}

/// Order of the channels of a frame.
#[derive(Clone, Copy)]
enum Order {
    Rgb,
    Bgr,
}

impl Order {
    fn named(name: &str) -> PyResult<Self> {
        match name {
            "rgb" => Ok(Self::Rgb),
            "bgr" => Ok(Self::Bgr),
            _ => Err(invalid(format!(
                "order must be \"rgb\" or \"bgr\" (OpenCV's), found {name:?}"
            ))),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Bgr => "bgr",
        }
    }

    /// Channels as red, green and blue. Grey levels have no order.
    fn rgb<'a>(self, frame: &'a GelPixels) -> GelImage<'a> {
        match (self, frame.view()) {
            (Self::Bgr, GelImage::Colour(levels)) => levels.slice_move(s![.., .., ..;-1]).into(),
            (_, image) => image,
        }
    }

    /// The message of a doubt, with the argument that resolves it.
    fn sentence(self, doubt: &FrameDoubt) -> String {
        let other = match self {
            Self::Rgb => "bgr",
            Self::Bgr => "rgb",
        };
        match doubt {
            FrameDoubt::ChannelsExchanged([2, 1, 0]) => {
                format!("{doubt}: convert the frame, or make the sensor with order={other:?}")
            }
            _ => doubt.to_string(),
        }
    }
}

#[pymethods]
impl GelSensor {
    /// Calibrates the sensor with presses of a ball.
    ///
    /// Parameters
    /// ----------
    /// reference : (rows, columns, 3) or (rows, columns) array of uint8
    ///     Frame without contact, in colours, or in grey levels for a gel that darkens.
    /// presses : sequence of arrays of the shape of reference
    ///     Five to twenty frames of the ball at different positions.
    /// ball_radius : float or (n,) array
    ///     Radius of the ball, or of the ball of each press, in metres.
    /// pixel_size : float
    ///     Size of a pixel on the gel in metres.
    /// order : str
    ///     "rgb", or "bgr" for frames from OpenCV, here and in `read`.
    /// circles : (n, 3) array
    ///     x, y and radius of the contacts in pixels. Those that are NaN are determined.
    /// layer : (thickness, Poisson's ratio, Young's modulus, its standard error)
    ///     The gel, in metres and pascals. Needed for forces.
    /// gauge : sequence of (frame, force)
    ///     Four or more frames of one body with gauge readings in newtons. They give forces if the
    ///     layer is not known.
    #[classmethod]
    #[pyo3(signature = (
        reference, presses, *, ball_radius, pixel_size, order="rgb", circles=None, layer=None,
        gauge=None
    ))]
    fn calibrate(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        presses: Vec<Bound<'_, PyAny>>,
        ball_radius: &Bound<'_, PyAny>,
        pixel_size: f64,
        order: &str,
        circles: Option<&Bound<'_, PyAny>>,
        layer: Option<(f64, f64, f64, f64)>,
        gauge: Option<Vec<(Bound<'_, PyAny>, f64)>>,
    ) -> PyResult<Self> {
        let order = Order::named(order)?;
        let gauge = gauge.unwrap_or_default().into_iter();
        let gauge = gauge.map(|(frame, force)| Ok((arrays::gel("gauge", &frame)?, force)));
        let gauge = gauge.collect::<PyResult<Vec<_>>>()?;
        let reference = arrays::gel("reference", reference)?;
        let frames = presses.iter().map(|frame| arrays::gel("presses", frame));
        let frames = frames.collect::<PyResult<Vec<_>>>()?;
        let radii = match ball_radius.extract::<f64>() {
            Ok(radius) => vec![radius; frames.len()],
            Err(_) => arrays::vector("ball_radius", ball_radius)?,
        };
        let circles = circles.map(|given| arrays::columns::<3>("circles", given));
        let circles = circles.transpose()?;
        let lengths = [radii.len(), circles.as_ref().map_or(frames.len(), Vec::len)];
        if lengths != [frames.len(); 2] {
            let expected = frames.len();
            return Err(invalid(format!(
                "ball_radius and circles must have the length {expected} of presses, \
                 found {lengths:?}"
            )));
        }
        let layer = layer.map(|(thickness, ratio, modulus, error)| {
            GelLayer::new(thickness, ratio, [modulus, error])
        });
        let found = py.detach(|| {
            let press = |k: usize| BallPress {
                circle_px: (circles.as_ref())
                    .map(|circles| circles[k])
                    .filter(|circle| circle.iter().all(|v| !v.is_nan())),
                ..BallPress::new(order.rgb(&frames[k]), radii[k])
            };
            let presses: Vec<_> = (0..frames.len()).map(press).collect();
            let (sensor, report) = Gel::calibrate(order.rgb(&reference), pixel_size, &presses)?;
            let readings = gauge
                .iter()
                .map(|(frame, force)| Ok((sensor.read(order.rgb(frame))?, *force)));
            let readings = readings.collect::<Result<Vec<_>, GelError>>()?;
            let pairs: Vec<_> = readings
                .iter()
                .map(|(frame, force)| (frame, *force))
                .collect();
            let gauge = (!pairs.is_empty())
                .then(|| GaugeForce::fit(&pairs))
                .transpose()?;
            Ok((
                CalibratedGel {
                    sensor,
                    grey: Grey::default(),
                    layer,
                    gauge,
                },
                report,
            ))
        });
        let found: Result<_, GelError> = found;
        let (gel, report) = found.map_err(errors::refused)?;
        Self::new(py, gel, order, Some(report))
    }

    /// Calibrates with the presses listed in a calibration file, like `tactile calibrate`.
    #[classmethod]
    #[pyo3(signature = (path, *, order="rgb"))]
    fn calibrate_file(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        path: PathBuf,
        order: &str,
    ) -> PyResult<Self> {
        let order = Order::named(order)?;
        let presses = GelPresses::read(path).map_err(errors::file)?;
        let found = py.detach(|| presses.calibrate());
        let (gel, report) = found.map_err(errors::refused)?;
        Self::new(py, gel, order, report)
    }

    /// A sensor of a gel that darkens, from a table of darkness and depth.
    ///
    /// Parameters
    /// ----------
    /// reference : (rows, columns) array of uint8
    ///     Frame without contact.
    /// table : (n, 2) array
    ///     Darkness in grey levels and depth in metres. Both increase. No darkness is no depth: a
    ///     table without the row 0, 0 is shifted.
    /// pixel_size : float
    ///     Size of a pixel on the gel in metres.
    #[classmethod]
    #[pyo3(signature = (reference, table, *, pixel_size))]
    fn darkening(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        table: &Bound<'_, PyAny>,
        pixel_size: f64,
    ) -> PyResult<Self> {
        let reference = arrays::gel("reference", reference)?;
        let table = arrays::columns::<2>("table", table)?;
        let sensor = Gel::new(DarkModel::new(pixel_size, table), reference.view());
        let gel = CalibratedGel {
            sensor: sensor.map_err(errors::refused)?,
            grey: Grey::default(),
            layer: None,
            gauge: None,
        };
        Self::new(py, gel, Order::Rgb, None)
    }

    /// Reads a sensor file written by `save` or `tactile calibrate`.
    #[classmethod]
    #[pyo3(signature = (path, *, order="rgb"))]
    fn load(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        path: PathBuf,
        order: &str,
    ) -> PyResult<Self> {
        let order = Order::named(order)?;
        let gel = GelFile::read(path).map_err(errors::file)?;
        Self::new(py, gel, order, None)
    }

    /// Writes the sensor file (TOML), and the frame without contact next to it.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.gel.write(path).map_err(errors::file)
    }

    /// Computes the surface, the contacts and the forces of a frame.
    ///
    /// Raises
    /// ------
    /// TactileError
    ///     The frame does not come from this sensor: black, white, noise, rotated, of another unit,
    ///     or with another order of channels.
    fn read(&self, py: Python<'_>, frame: &Bound<'_, PyAny>) -> PyResult<GelFrame> {
        self.measured(py, frame, None)
    }

    /// Reads frames one after the other and follows the dots of the gel, for shear and slip.
    ///
    /// Raises
    /// ------
    /// TactileError
    ///     The gel has no dots (`has_dots`).
    fn follower(slf: &Bound<'_, Self>) -> PyResult<GelFollower> {
        let sensor = &slf.get().gel.sensor;
        if !sensor.has_dots() {
            return Err(TactileError::new_err(
                "the gel has no printed dots to follow",
            ));
        }
        Ok(GelFollower {
            sensor: slf.clone().unbind(),
            markers: Mutex::new(GelMarkers::new(sensor)),
        })
    }

    /// Whether dots are printed on the gel.
    #[getter]
    fn has_dots(&self) -> bool {
        self.gel.sensor.has_dots()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        of_values(slf.py(), "reduced_gel", (slf,))
    }

    /// Report of the calibration. None for a sensor that was loaded.
    #[getter]
    fn report(&self, py: Python<'_>) -> Option<Py<GelReport>> {
        self.report.as_ref().map(|report| report.clone_ref(py))
    }

    /// Size of a pixel on the gel in metres.
    #[getter]
    fn pixel_size(&self) -> f64 {
        self.gel.sensor.pixel_size_m()
    }

    /// Rows and columns of its frames.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.gel.sensor.shape()
    }

    /// Order of the channels of its frames.
    #[getter]
    fn order(&self) -> &'static str {
        self.order.name()
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        format!(
            "GelSensor({columns} × {rows} pixels, order {:?})",
            self.order()
        )
    }
}

impl GelSensor {
    fn measured(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        markers: Option<&Mutex<GelMarkers>>,
    ) -> PyResult<GelFrame> {
        let given = arrays::gel("frame", frame)?;
        let found = py.detach(|| {
            let image = self.order.rgb(&given);
            let frame = self.gel.sensor.read(image)?;
            let mut forces = Forces {
                normal: (self.law.as_ref()).map(|law| (law.forces(&frame), law.force(&frame))),
                ..Forces::default()
            };
            let mut doubt = None;
            if let Some(markers) = markers.filter(|_| !frame.is_refused()) {
                // A follower that panicked has its last state.
                let mut markers = markers.lock().unwrap_or_else(PoisonError::into_inner);
                // Depth and contacts do not depend on the dots.
                doubt = match markers.follow(image, &frame) {
                    Ok(slip) => {
                        forces.slip = slip;
                        markers.field().doubt.map(|doubt| doubt.to_string())
                    }
                    Err(error) => Some(error.to_string()),
                };
                if let (Some(GelLaw::Layer(law)), None) = (&self.law, &doubt) {
                    forces.wrench = law.wrench(&frame, Some(markers.field()));
                }
            }
            Ok((frame, forces, doubt))
        });
        let found: Result<_, GelError> = found;
        let (frame, forces, doubt) = found.map_err(errors::refused)?;
        let flags = frame.doubts.iter().map(|doubt| self.order.sentence(doubt));
        if frame.is_refused() {
            return Err(TactileError::new_err(flags.collect::<Vec<_>>().join("; ")));
        }
        let flags = flags.chain(doubt).collect();
        GelFrame::of(py, frame, flags, forces, self.pixel_size())
    }

    fn new(
        py: Python<'_>,
        gel: CalibratedGel,
        order: Order,
        report: Option<CalibrationReport>,
    ) -> PyResult<Self> {
        let law = gel.law().map_err(errors::refused)?;
        let report = report.map(|report| {
            let circles = Array2::from_shape_fn((report.circles.len(), 3), |(n, k)| {
                report.circles[n]
                    .used_px
                    .map_or(f64::NAN, |circle| circle[k])
            });
            let model = gel.sensor.model();
            let angle = report.median_angle_deg;
            Py::new(
                py,
                GelReport {
                    text: format!("normals of presses left out {angle:.2}° off in the median"),
                    circles: kept(py, circles),
                    median_angle: angle,
                    slope_error: model.slope_standard_error(),
                    depth_error: model.depth_standard_error_m(),
                    flags: report.doubts.iter().map(ToString::to_string).collect(),
                },
            )
        });
        Ok(Self {
            report: report.transpose()?,
            gel,
            law,
            order,
        })
    }
}

/// Reads frames one after the other and follows the dots of the gel.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct GelFollower {
    sensor: Py<GelSensor>,
    markers: Mutex<GelMarkers>,
}

#[pymethods]
impl GelFollower {
    /// Like `GelSensor.read`, with shear, torque and slip. Between two frames dots on a grid must move
    /// by less than a sixth of their pitch.
    fn read(&self, py: Python<'_>, frame: &Bound<'_, PyAny>) -> PyResult<GelFrame> {
        self.sensor.get().measured(py, frame, Some(&self.markers))
    }

    fn __repr__(&self) -> String {
        format!("GelFollower({})", self.sensor.get().__repr__())
    }
}

/// What is measured of a frame besides its face.
#[derive(Default)]
struct Forces {
    /// Normal force of each contact, and of all.
    normal: Option<(Vec<CoreEstimate>, Option<CoreEstimate>)>,
    /// Forces along x and y and torque about z, from the dots.
    wrench: Option<GelWrench>,
    slip: Option<MarkerSlip>,
}

impl GelFrame {
    fn of(
        py: Python<'_>,
        frame: Frame,
        flags: Vec<String>,
        forces: Forces,
        pixel_size: f64,
    ) -> PyResult<Self> {
        let (each, force) = forces.normal.unwrap_or_default();
        let contacts = frame.contacts.iter().enumerate().map(|(k, contact)| {
            let estimate = |estimate| Estimate::of(py, estimate);
            let [x, y] = contact.centroid_px;
            let outline = Array2::from_shape_fn((contact.outline_px.len(), 2), |(n, k)| {
                contact.outline_px[n][k] as i64
            });
            Py::new(
                py,
                GelContact {
                    text: format!(
                        "at ({:.1}, {:.1}) px, {:.3} mm deep",
                        x.value,
                        y.value,
                        1e3 * contact.depth_m.value
                    ),
                    x: estimate(x)?,
                    y: estimate(y)?,
                    area: estimate(contact.area_m2)?,
                    depth: estimate(contact.depth_m)?,
                    depth_below_far: estimate(contact.depth_below_far_m)?,
                    force: each.get(k).copied().map(estimate).transpose()?,
                    outline: kept(py, outline),
                    touches_edge: contact.touches_border,
                },
            )
        });
        let [pixel, rest] = frame.depth_standard_error_m;
        let [p, q] = frame.gradient;
        let estimate =
            |value: Option<CoreEstimate>| value.map(|value| Estimate::of(py, value)).transpose();
        let [shear_x, shear_y] = [0, 1].map(|k| forces.wrench.and_then(|w| w.force_n[k]));
        let contacts = contacts.collect::<PyResult<Vec<_>>>()?;
        let with_force = force.map_or_else(String::new, |f| format!(", force {:.4} N", f.value));
        Ok(Self {
            text: format!("{} contacts{with_force}", contacts.len()),
            contacts,
            shear: estimate(shear_x)?.zip(estimate(shear_y)?),
            torque: estimate(forces.wrench.and_then(|w| w.torque_nm[2]))?,
            slip: forces.slip.map(|slip| slip.share),
            depth: kept(py, frame.depth_m),
            gradient: (kept(py, p), kept(py, q)),
            depth_error: (pixel, rest),
            labels: kept(py, frame.labels),
            force: estimate(force)?,
            flags,
            pixel_size,
        })
    }
}

/// Follows the markers printed on a gel from a reference to a frame.
///
/// Parameters
/// ----------
/// reference, frame : (rows, columns) or (rows, columns, 3) arrays of uint8
///
/// Returns
/// -------
/// Markers
///     Positions and displacements of the markers that are visible in both.
#[pyfunction]
pub(crate) fn markers(
    py: Python<'_>,
    reference: &Bound<'_, PyAny>,
    frame: &Bound<'_, PyAny>,
) -> PyResult<Markers> {
    let [reference, frame] = [
        arrays::grey("reference", reference)?,
        arrays::grey("frame", frame)?,
    ];
    if reference.dim() != frame.dim() {
        let shapes = (reference.dim(), frame.dim());
        return Err(invalid(format!(
            "reference and frame must have one shape, found {shapes:?}"
        )));
    }
    let found = py.detach(|| {
        let [before, after] = [&reference, &frame].map(|image| find_markers(image.view()));
        track_markers(&before, &after)
    });
    let field = found.map_err(|error| match error {
        MatchError::Custom(_) => errors::failed(error),
        _ => TactileError::new_err(format!("no markers to follow: {error}")),
    })?;
    let tracks: Vec<_> = field.seen().collect();
    let n = tracks.len();
    let table = |value: &dyn Fn(usize, usize) -> f64| {
        kept(py, Array2::from_shape_fn((n, 2), |(n, k)| value(n, k)))
    };
    let largest = field.largest_px().map_or(0.0, |px| px.value);
    Ok(Markers {
        text: format!("{n} followed, by {largest:.2} px at most"),
        positions: table(&|n, k| tracks[n].position_px[k]),
        displacements: table(&|n, k| tracks[n].displacement_px[k]),
        standard_errors: table(&|n, k| tracks[n].standard_errors_px[k]),
        period: field.period.map(|step| step.0[..2].to_vec()),
        flags: field.doubt.iter().map(ToString::to_string).collect(),
    })
}
