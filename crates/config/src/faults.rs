//! `[[fault]]` of a drive file.

use car::{FailedReading, FailedSensor, Fault, FaultKind};
use geartrain::Gearbox;
use serde::Deserialize;
use toml::Spanned;

use crate::ConfigError;
use crate::check::{Check, Number, Word};

/// Something that breaks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(crate) struct RawFault {
    kind: Spanned<RawKind>,
    from_s: Number,
    element: Option<Word>,
    elements: Option<Spanned<Vec<String>>>,
    friction_factor: Option<Number>,
    lag_factor: Option<Number>,
    command: Option<Number>,
    pressure_fraction: Option<Number>,
    pressure_pa: Option<Number>,
    sensor: Option<Spanned<RawSensor>>,
    reading: Option<Spanned<RawReading>>,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum RawKind {
    WeakClutch,
    WrongFluid,
    StuckSolenoid,
    SwappedSolenoids,
    LeakingPiston,
    LinePressure,
    Aeration,
    GlazedPlates,
    SpeedSensor,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum RawSensor {
    Engine,
    Turbine,
    Output,
    Wheel,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum RawReading {
    Zero,
    Frozen,
    None,
}

impl RawKind {
    /// Its keys beside `kind` and `from_s`; those of the second list may be left out.
    fn keys(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::WeakClutch => (&["element", "friction_factor"], &[]),
            Self::WrongFluid => (&["friction_factor"], &[]),
            Self::StuckSolenoid => (&["element"], &["command"]),
            Self::SwappedSolenoids => (&["elements"], &[]),
            Self::LeakingPiston => (&["element", "pressure_fraction"], &[]),
            Self::LinePressure => (&["pressure_pa"], &[]),
            Self::Aeration => (&["lag_factor"], &[]),
            Self::GlazedPlates => (&["element", "friction_factor"], &[]),
            Self::SpeedSensor => (&["sensor", "reading"], &[]),
        }
    }
}

impl RawFault {
    /// The fault.
    ///
    /// # Errors
    /// A key is missing, has no sense for this kind, or is out of range.
    pub(crate) fn checked(&self, check: &Check<'_>) -> Result<Fault, ConfigError> {
        self.check_keys(check)?;
        let number = |key: &str, value: &Option<Number>, range| match value {
            Some(value) => check.number(format_args!("fault.{key}"), value, range),
            None => Err(self.missing(check, key)),
        };
        let element = || match &self.element {
            Some(element) => Ok(element.get_ref().clone()),
            None => Err(self.missing(check, "element")),
        };
        let friction = || number("friction_factor", &self.friction_factor, 0.0..=10.0);
        let kind = match *self.kind.get_ref() {
            RawKind::WeakClutch => FaultKind::Friction { element: Some(element()?), factor: friction()? },
            RawKind::WrongFluid => FaultKind::Friction { element: None, factor: friction()? },
            RawKind::StuckSolenoid => FaultKind::StuckSolenoid {
                element: element()?,
                command: self.command.as_ref().map(|_| number("command", &self.command, 0.0..=100.0)).transpose()?,
            },
            RawKind::SwappedSolenoids => FaultKind::SwappedSolenoids(self.two(check)?),
            RawKind::LeakingPiston => FaultKind::LeakingPiston {
                element: element()?,
                pressure_fraction: number("pressure_fraction", &self.pressure_fraction, 0.0..=1.0)?,
            },
            RawKind::LinePressure => {
                FaultKind::LinePressure { pressure_pa: number("pressure_pa", &self.pressure_pa, 0.0..=1e8)? }
            }
            RawKind::Aeration => {
                FaultKind::Aeration { lag_factor: number("lag_factor", &self.lag_factor, 0.1..=100.0)? }
            }
            RawKind::GlazedPlates => FaultKind::GlazedPlates {
                element: element()?,
                friction_factor: number("friction_factor", &self.friction_factor, 0.0..=1.0)?,
            },
            RawKind::SpeedSensor => {
                let sensor = self.sensor.as_ref().ok_or_else(|| self.missing(check, "sensor"))?;
                let reading = self.reading.as_ref().ok_or_else(|| self.missing(check, "reading"))?;
                FaultKind::SpeedSensor {
                    sensor: match sensor.get_ref() {
                        RawSensor::Engine => FailedSensor::Engine,
                        RawSensor::Turbine => FailedSensor::Turbine,
                        RawSensor::Output => FailedSensor::Output,
                        RawSensor::Wheel => FailedSensor::Wheel,
                    },
                    reading: match reading.get_ref() {
                        RawReading::Zero => FailedReading::Zero,
                        RawReading::Frozen => FailedReading::Frozen,
                        RawReading::None => FailedReading::None,
                    },
                }
            }
        };
        Ok(Fault { kind, from_s: check.number("fault.from_s", &self.from_s, 0.0..=1e9)? })
    }

    /// Checks that a gearbox has the clutches and brakes that it names.
    ///
    /// # Errors
    /// The gearbox has none of such a name.
    pub(crate) fn check_elements(&self, check: &Check<'_>, gearbox: &Gearbox) -> Result<(), ConfigError> {
        let of_one = self.element.iter().map(|name| ("fault.element", name.get_ref(), name.span().start));
        let of_two = self
            .elements
            .iter()
            .flat_map(|names| names.get_ref().iter().map(|name| ("fault.elements", name, names.span().start)));
        let known: Vec<&str> = gearbox.with_plates().map(|element| element.name.as_str()).collect();
        match of_one.chain(of_two).find(|(_, name, _)| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some((key, name, at)) => {
                let message = format!("the gearbox has no clutch or brake \"{name}\"");
                let hint = format!("its clutches and brakes are {}", known.join(", "));
                Err(check.meaning(key, at, message, Some(hint)))
            }
        }
    }

    /// Each key has to be one of this kind, and those of the kind have to be there.
    fn check_keys(&self, check: &Check<'_>) -> Result<(), ConfigError> {
        let (needed, optional) = self.kind.get_ref().keys();
        let given = [
            ("element", self.element.is_some()),
            ("elements", self.elements.is_some()),
            ("friction_factor", self.friction_factor.is_some()),
            ("lag_factor", self.lag_factor.is_some()),
            ("command", self.command.is_some()),
            ("pressure_fraction", self.pressure_fraction.is_some()),
            ("pressure_pa", self.pressure_pa.is_some()),
            ("sensor", self.sensor.is_some()),
            ("reading", self.reading.is_some()),
        ];
        for (key, is_given) in given {
            if is_given && !needed.contains(&key) && !optional.contains(&key) {
                return Err(self.wrong(check, format!("`{key}` has no effect with this kind")));
            }
            if !is_given && needed.contains(&key) {
                return Err(self.missing(check, key));
            }
        }
        Ok(())
    }

    /// The two elements whose valves are swapped.
    fn two(&self, check: &Check<'_>) -> Result<[String; 2], ConfigError> {
        match self.elements.as_ref().map(|elements| elements.get_ref().as_slice()) {
            Some([one, other]) if one != other => Ok([one.clone(), other.clone()]),
            _ => Err(self.wrong(check, "`elements` has to name two elements".to_owned())),
        }
    }

    fn missing(&self, check: &Check<'_>, key: &str) -> ConfigError {
        self.wrong(check, format!("`{key}` is missing"))
    }

    fn wrong(&self, check: &Check<'_>, message: String) -> ConfigError {
        let (needed, optional) = self.kind.get_ref().keys();
        let keys =
            needed.iter().map(|key| (*key).to_owned()).chain(optional.iter().map(|key| format!("{key} (optional)")));
        let hint = format!("a fault of this kind has kind, from_s, {}", keys.collect::<Vec<_>>().join(", "));
        check.meaning("fault", self.kind.span().start, message, Some(hint))
    }
}

#[cfg(test)]
mod tests {
    use car::{FailedReading, FailedSensor, Fault, FaultKind};

    use crate::{DriveFile, Source};

    fn faults(lines: &str) -> Result<Vec<Fault>, String> {
        let text = format!("name = \"d\"\nsegment = [{{ duration_s = 1, throttle = 0 }}]\n{lines}");
        let file = DriveFile::from_source(Source::built_in("drive.toml", &text));
        file.map(|file| file.drive.faults).map_err(|error| error.to_string())
    }

    #[test]
    fn each_kind_has_its_keys() {
        let element = || "C".to_owned();
        for (keys, kind) in [
            (
                "kind = \"weak-clutch\"\nelement = \"C\"\nfriction_factor = 0.3",
                FaultKind::Friction { element: Some(element()), factor: 0.3 },
            ),
            ("kind = \"wrong-fluid\"\nfriction_factor = 0.6", FaultKind::Friction { element: None, factor: 0.6 }),
            (
                "kind = \"stuck-solenoid\"\nelement = \"C\"",
                FaultKind::StuckSolenoid { element: element(), command: None },
            ),
            (
                "kind = \"stuck-solenoid\"\nelement = \"C\"\ncommand = 0",
                FaultKind::StuckSolenoid { element: element(), command: Some(0.0) },
            ),
            (
                "kind = \"swapped-solenoids\"\nelements = [\"C\", \"E\"]",
                FaultKind::SwappedSolenoids([element(), "E".to_owned()]),
            ),
            (
                "kind = \"leaking-piston\"\nelement = \"C\"\npressure_fraction = 0.5",
                FaultKind::LeakingPiston { element: element(), pressure_fraction: 0.5 },
            ),
            ("kind = \"line-pressure\"\npressure_pa = 4e5", FaultKind::LinePressure { pressure_pa: 4e5 }),
            ("kind = \"aeration\"\nlag_factor = 3", FaultKind::Aeration { lag_factor: 3.0 }),
            (
                "kind = \"glazed-plates\"\nelement = \"C\"\nfriction_factor = 0.5",
                FaultKind::GlazedPlates { element: element(), friction_factor: 0.5 },
            ),
            (
                "kind = \"speed-sensor\"\nsensor = \"turbine\"\nreading = \"frozen\"",
                FaultKind::SpeedSensor { sensor: FailedSensor::Turbine, reading: FailedReading::Frozen },
            ),
        ] {
            assert_eq!(
                faults(&format!("[[fault]]\nfrom_s = 7\n{keys}\n")),
                Ok(vec![Fault { kind, from_s: 7.0 }]),
                "{keys}"
            );
        }
        assert_eq!(faults(""), Ok(Vec::new()));
    }

    #[test]
    fn a_fault_with_other_keys_is_refused_with_those_that_it_has() {
        for (keys, said) in [
            ("kind = \"weak-clutch\"\nelement = \"C\"", "`friction_factor` is missing"),
            ("kind = \"aeration\"\nlag_factor = 3\nelement = \"C\"", "`element` has no effect with this kind"),
            ("kind = \"swapped-solenoids\"\nelements = [\"C\"]", "`elements` has to name two elements"),
            ("kind = \"swapped-solenoids\"\nelements = [\"C\", \"C\"]", "`elements` has to name two elements"),
            ("kind = \"speed-sensor\"\nsensor = \"turbine\"", "`reading` is missing"),
            ("kind = \"speed-sensor\"\nsensor = \"car\"\nreading = \"zero\"", "unknown variant `car`"),
            ("kind = \"glazed-plates\"\nelement = \"C\"\nfriction_factor = 2", "is 2, expected 0 to 1"),
            ("kind = \"line-pressure\"\npressure_pa = -1", "is -1, expected 0 to"),
            ("kind = \"line-pressure\"\npressure_pa = nan", "fault.pressure_pa"),
            ("kind = \"broken\"", "unknown variant `broken`"),
        ] {
            let error = faults(&format!("[[fault]]\nfrom_s = 7\n{keys}\n")).unwrap_err();
            assert!(error.contains(said) && error.contains("drive.toml:"), "{keys}: {error}");
        }
    }
}
