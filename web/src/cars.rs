//! The cars of the page: shipped vehicle files with their gearboxes.

use config::{CarFile, Source};
use serde_json::{Value, json};
use wetclutch::Error;

/// A shipped vehicle file.
pub(crate) struct ShippedCar {
    /// The name of the file, without its ending.
    pub(crate) name: &'static str,
    /// The vehicle file.
    pub(crate) text: &'static str,
    /// The file of its gearbox, by its name and its text.
    gearbox: [&'static str; 2],
}

/// A car with its vehicle file and its gearbox file.
macro_rules! shipped {
    ($name:literal, $gearbox:literal) => {
        ShippedCar {
            name: $name,
            text: include_str!(concat!("../../vehicles/", $name, ".toml")),
            gearbox: [concat!($gearbox, ".toml"), include_str!(concat!("../../gearboxes/", $gearbox, ".toml"))],
        }
    };
}

/// The cars, the one first that the page begins with.
pub(crate) const CARS: [ShippedCar; 6] = [
    shipped!("eight_speed", "8hp"),
    shipped!("six_speed", "lepelletier_6"),
    shipped!("ten_speed", "10_speed"),
    shipped!("dual_clutch", "dual_clutch_7"),
    shipped!("four_speed", "ravigneaux_4"),
    shipped!("four_speed_one_way", "ravigneaux_4_one_way"),
];

/// The file whose values the others take where they have none of their own.
pub(crate) const DEFAULTS: &str = include_str!("../../vehicles/eight_speed.toml");

impl ShippedCar {
    /// The car of this name.
    ///
    /// # Errors
    /// There is none.
    pub(crate) fn named(name: &str) -> Result<&'static Self, Error> {
        CARS.iter().find(|car| car.name == name).ok_or_else(|| {
            let names: Vec<&str> = CARS.iter().map(|car| car.name).collect();
            Error::Input(format!(
                "car: there is no `{}`\nhint: expected one of {}",
                name.escape_debug(),
                names.join(", ")
            ))
        })
    }

    /// The name of its vehicle file.
    pub(crate) fn file(&self) -> String {
        format!("{}.toml", self.name)
    }

    /// The car of a vehicle file with the gearbox of this one; `called` is what messages call the file.
    ///
    /// # Errors
    /// A value of the file cannot be right.
    pub(crate) fn read(&self, called: &str, text: &str) -> Result<CarFile, Error> {
        let [gearbox, gearbox_text] = self.gearbox;
        Ok(CarFile::from_sources(Source::built_in(called, text), Source::built_in(gearbox, gearbox_text))?)
    }
}

/// The cars with the names of their forward gears, for the choices of the page.
pub(crate) fn described() -> Result<Value, Error> {
    let one = |car: &ShippedCar| -> Result<Value, Error> {
        let file = car.read(car.name, car.text)?;
        let gearbox = &file.gearbox;
        let gears: Vec<&str> = gearbox.forward_gears().iter().map(|gear| gearbox.gears[*gear].name.as_str()).collect();
        Ok(json!({
            "name": car.name,
            "title": file.name,
            "gearbox": car.gearbox[0],
            "gears": gears,
            "mass_kg": file.road.mass_kg,
            "oil_degc": file.oil_temperature_degc,
        }))
    };
    let cars = CARS.iter().map(one).collect::<Result<Vec<_>, _>>()?;
    Ok(json!({ "cars": cars, "version": env!("CARGO_PKG_VERSION") }))
}
