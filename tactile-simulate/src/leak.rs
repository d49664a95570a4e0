//! Pressure and leaked light of a contact, averaged over pixels.

use super::contact::Contact;
use super::light::Response;
use super::pixel_average::{Disc, Patch, Plane, Profile, Window};

/// From pressure to light in one scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LightLaw {
    pub(super) response: Response,
    /// Grey levels per pascal, g.
    pub(super) grey_per_pascal: f64,
    /// The scene's largest pressure p_max, to which the response is relative.
    pub(super) largest_pressure_pa: f64,
}

impl LightLaw {
    /// Light at a pressure, in grey levels above the background.
    pub(super) fn grey_at(&self, pressure_pa: f64) -> f64 {
        if self.largest_pressure_pa == 0.0 {
            return 0.0;
        }
        let share = pressure_pa / self.largest_pressure_pa;
        self.grey_per_pascal * self.largest_pressure_pa * self.response.light(share)
    }

    /// Unblurred light of a contact as a lens that distorts shows it.
    pub(super) fn bent_patch(
        &self,
        contact: &Contact,
        disc: &Disc,
        plane: Plane,
        window: Window,
    ) -> Patch {
        disc.average_bent(plane, window, |r_m| self.grey_at(contact.pressure_pa(r_m)))
    }

    /// Unblurred light of a contact over `window`, in grey levels above the background.
    pub(super) fn patch(&self, contact: &Contact, disc: &Disc, window: Window) -> Patch {
        if self.largest_pressure_pa == 0.0 {
            return Patch::zeros(window);
        }
        let exact = contact.is_hertzian() && !matches!(self.response, Response::Power { .. });
        if !exact {
            return disc.average_radial(window, |r_m| self.grey_at(contact.pressure_pa(r_m)));
        }
        let peak = contact.peak_pressure_pa;
        let mut patch = disc.average(Profile::Hemisphere, window);
        patch
            .values
            .map_inplace(|v| *v *= self.grey_per_pascal * peak);
        let droop = self.response.droop() / self.largest_pressure_pa;
        if droop > 0.0 {
            let square = disc.average(Profile::Paraboloid, window);
            patch
                .values
                .scaled_add(-self.grey_per_pascal * droop * peak * peak, &square.values);
        }
        patch
    }
}

/// Pressure of a contact over `window` in pascal.
pub(super) fn pressure_patch(contact: &Contact, disc: &Disc, window: Window) -> Patch {
    if !contact.is_hertzian() {
        return disc.average_radial(window, |r_m| contact.pressure_pa(r_m));
    }
    let mut patch = disc.average(Profile::Hemisphere, window);
    patch.values.map_inplace(|v| *v *= contact.peak_pressure_pa);
    patch
}
