//! `modelDescription.xml`.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::Version;
use super::variables::{Variable, variables};
use crate::{ExportedFilter, Image};

/// A model as its description names it.
pub(crate) struct Description {
    pub(crate) name: String,
    /// Name of its shared library, without an ending.
    pub(crate) library: &'static str,
    pub(crate) about: String,
    /// `guid` and `instantiationToken`.
    pub(crate) token: String,
    /// Whether its state can be written as bytes.
    pub(crate) is_serialised: bool,
    pub(crate) variables: Vec<Variable>,
}

impl Description {
    /// That of a filter. The library compares the first eight digits of the token with the checksum of the parameters.
    pub(crate) fn of_observer(filter: &ExportedFilter, image: &Image) -> Self {
        let checksum = image.header().map_or(0, |header| header.checksum);
        let digits = |from: usize, to: usize| filter.vehicle_sha256.get(from..to).unwrap_or_default();
        let token =
            format!("{{{checksum:08x}-{}-{}-{}-{}}}", digits(0, 4), digits(4, 8), digits(8, 12), digits(12, 24));
        Self {
            name: format!("wetclutch_{}", filter.name),
            about: format!("Observer of clutch pressures and torques: {}", filter.car.name),
            token,
            library: "wetclutch_fmu",
            is_serialised: true,
            variables: variables(filter),
        }
    }

    pub(crate) fn xml(&self, version: Version) -> String {
        match version {
            Version::Two => self.xml_2(),
            Version::Three => self.xml_3(),
        }
    }

    fn xml_2(&self) -> String {
        let Self { library, is_serialised, .. } = self;
        let variables: String = self.variables.iter().map(Variable::xml_2).collect();
        let outputs = self.lines(|index, _| format!("      <Unknown index=\"{index}\"/>\n"));
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"2.0\" guid=\"{}\" {}>\n  \
             <CoSimulation modelIdentifier=\"{library}\" canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"{is_serialised}\"/>\n\
             {}  <ModelVariables>\n{variables}  </ModelVariables>\n  <ModelStructure>\n    <Outputs>\n{outputs}    </Outputs>\n    \
             <InitialUnknowns>\n{outputs}    </InitialUnknowns>\n  </ModelStructure>\n</fmiModelDescription>\n",
            self.token,
            self.attributes(),
            self.common(),
        )
    }

    fn xml_3(&self) -> String {
        let Self { library, is_serialised, .. } = self;
        let variables: String = self.variables.iter().map(Variable::xml_3).collect();
        let list = |kind: &str| self.lines(|_, reference| format!("    <{kind} valueReference=\"{reference}\"/>\n"));
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"3.0\" instantiationToken=\"{}\" {}>\n  \
             <CoSimulation modelIdentifier=\"{library}\" canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"{is_serialised}\"/>\n\
             {}  <ModelVariables>\n    \
             <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" variability=\"continuous\" unit=\"s\" description=\"time\"/>\n\
             {variables}  </ModelVariables>\n  <ModelStructure>\n{}{}  </ModelStructure>\n</fmiModelDescription>\n",
            self.token,
            self.attributes(),
            self.common(),
            list("Output"),
            list("InitialUnknown"),
        )
    }

    fn attributes(&self) -> String {
        format!(
            "modelName=\"{}\" description=\"{}\" generationTool=\"wetclutch {}\" variableNamingConvention=\"structured\"",
            self.name,
            escaped(&self.about),
            env!("CARGO_PKG_VERSION"),
        )
    }

    /// What is the same in both versions.
    fn common(&self) -> String {
        let units: BTreeSet<&str> = self.variables.iter().filter_map(Variable::named_unit).chain(["s"]).collect();
        let units: String = units.into_iter().map(unit_definition).collect();
        format!(
            "  <UnitDefinitions>\n{units}  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n  \
             <DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"0.01\"/>\n"
        )
    }

    /// A line for each output, by its index from 1 on and its reference.
    fn lines(&self, line: impl Fn(usize, usize) -> String) -> String {
        let outputs = self.variables.iter().zip(1..).filter(|(variable, _)| variable.start.is_none());
        outputs.map(|(variable, index)| line(index, variable.reference)).collect()
    }
}

impl Variable {
    /// Its unit; a number without one has none, and neither has a whole number.
    fn named_unit(&self) -> Option<&'static str> {
        (self.is_real && self.unit != "1").then_some(self.unit)
    }

    /// Name, reference, kind and meaning.
    fn attributes(&self) -> String {
        let kind = match self.start {
            Some(_) => "causality=\"input\" variability=\"discrete\"",
            None => "causality=\"output\" variability=\"discrete\" initial=\"calculated\"",
        };
        let (name, reference) = (&self.name, self.reference);
        format!("name=\"{name}\" valueReference=\"{reference}\" {kind} description=\"{}\"", escaped(&self.meaning))
    }

    /// Unit and start.
    fn value(&self) -> String {
        let mut text = String::new();
        if let Some(unit) = self.named_unit() {
            let _ = write!(text, " unit=\"{unit}\"");
        }
        if let Some(start) = self.start {
            let _ = write!(text, " start=\"{start}\"");
        }
        text
    }

    fn xml_2(&self) -> String {
        let kind = if self.is_real { "Real" } else { "Integer" };
        format!("    <ScalarVariable {}>\n      <{kind}{}/>\n    </ScalarVariable>\n", self.attributes(), self.value())
    }

    fn xml_3(&self) -> String {
        let kind = if self.is_real { "Float64" } else { "Int32" };
        format!("    <{kind} {}{}/>\n", self.attributes(), self.value())
    }
}

/// A unit with its powers of the base units, factor and offset.
fn unit_definition(unit: &str) -> String {
    let base = match unit {
        "Pa" => "kg=\"1\" m=\"-1\" s=\"-2\"",
        "N m" => "kg=\"1\" m=\"2\" s=\"-2\"",
        "rad/s" => "rad=\"1\" s=\"-1\"",
        "s" => "s=\"1\"",
        "A" => "A=\"1\"",
        "%" => "factor=\"0.01\"",
        "rad" => "rad=\"1\"",
        "m/s" => "m=\"1\" s=\"-1\"",
        "degC" => "K=\"1\" offset=\"273.15\"",
        _ => return format!("    <Unit name=\"{unit}\"/>\n"),
    };
    format!("    <Unit name=\"{unit}\">\n      <BaseUnit {base}/>\n    </Unit>\n")
}

/// Text that may stand in an attribute.
fn escaped(text: &str) -> String {
    let text = text.replace(|c: char| c.is_control(), " ").replace('&', "&amp;");
    text.replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_a_car_cannot_end_its_attribute() {
        assert_eq!(escaped("a \"b\" <c> & d\n"), "a &quot;b&quot; &lt;c&gt; &amp; d ");
    }
}
