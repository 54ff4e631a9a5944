//! `documentation/index.html`: what the FMU is, its variables, and how to use it.

use std::io;

use quick_xml::events::{BytesText, Event};

use super::FmiVersion;
use super::description::{Xml, document, title};
use super::table::{Slot, Table};
use crate::error::Result;
use crate::simulation::Simulation;

const STYLE: &str = "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em}\
table{border-collapse:collapse}td,th{border:1px solid #bbb;padding:.2em .5em;text-align:left;\
vertical-align:top}pre{background:#f3f3f3;padding:1em;overflow:auto}";

pub(super) fn page(simulation: &Simulation, table: &Table) -> Result<String> {
    let title = title(simulation);
    let html = document(|xml| {
        xml.write_event(Event::DocType(BytesText::from_escaped("html")))?;
        xml.create_element("html")
            .with_attribute(("lang", "en"))
            .write_inner_content(|xml| {
                xml.create_element("head").write_inner_content(|xml| {
                    xml.create_element("meta")
                        .with_attribute(("charset", "utf-8"))
                        .write_empty()?;
                    text(xml, "title", &title)?;
                    text(xml, "style", STYLE)
                })?;
                xml.create_element("body").write_inner_content(|xml| {
                    text(xml, "h1", &title)?;
                    introduction(xml, simulation)?;
                    text(xml, "h2", "How to use it")?;
                    usage(xml, simulation, table)?;
                    text(xml, "h2", "Variables")?;
                    variables(xml, table)?;
                    text(xml, "h2", "Licence")?;
                    text(
                        xml,
                        "p",
                        "MIT or Apache-2.0, as you choose; the texts are in the folder licenses.",
                    )
                })?;
                Ok(())
            })?;
        Ok(())
    })?;
    // HTML, not XHTML: a browser expects the document type first.
    Ok(html
        .split_once('\n')
        .map_or(html.clone(), |(_, rest)| rest.to_owned()))
}

fn text(xml: &mut Xml, name: &str, content: &str) -> io::Result<()> {
    xml.create_element(name)
        .write_text_content(BytesText::new(content))?;
    Ok(())
}

fn introduction(xml: &mut Xml, simulation: &Simulation) -> io::Result<()> {
    text(
        xml,
        "p",
        "A body in motion at large strain, computed with Updated Reference Lagrangian smoothed \
         particle hydrodynamics. The importer sets loads and heat on named patches of the boundary and \
         reads how the body answers: forces, motion, temperatures, energies, probes and fields.",
    )?;
    let plan = simulation.plan();
    text(
        xml,
        "p",
        &format!(
            "{} particles, {} pairs; stable time step at the start {:.3e} s, about {} steps to {} s.",
            plan.particles,
            plan.pairs,
            plan.stable_step,
            plan.steps,
            simulation.scene().time.end
        ),
    )?;
    for (heading, lines) in [("On", &plan.on), ("Off", &plan.off)] {
        if !lines.is_empty() {
            text(xml, "p", &format!("{heading}: {}.", lines.join("; ")))?;
        }
    }
    Ok(())
}

fn usage(xml: &mut Xml, simulation: &Simulation, table: &Table) -> io::Result<()> {
    let mut points = vec![
        "All values are in SI units. Positions, areas and normals are those of the initial \
         configuration; components are in the directions of X, Y and Z; tensors are row by row."
            .to_owned(),
        "An input keeps its value until it is set again. A communication step of any length more than 0 \
         is made of as many stable time steps as it needs and ends exactly at its end."
            .to_owned(),
        "Forces on a patch are those of the surroundings on the body: loads and support reactions; heat \
         flows are counted into the body. They answer an input at once, all other outputs answer \
         through the next step. Temperatures are absolute."
            .to_owned(),
        "The simulation starts at 0; with another start time of the experiment, the times in the scene \
         count from there."
            .to_owned(),
        "The state of the FMU can be stored, restored and serialised: a step that is repeated from a \
         stored state gives the same bits, with any number of threads."
            .to_owned(),
        "Parameters can be set until the end of initialisation, in any order. A value that is not \
         admissible is refused when it is set; values that do not go together, such as a yield stress \
         above the saturation stress, are refused at the end of initialisation, and when an output is \
         read before."
            .to_owned(),
        "If the solution diverges, the step fails with the particle, field and time in the log, and the \
         last good state stays readable: continue from a stored state with other inputs, or reset."
            .to_owned(),
    ];
    if table.version == FmiVersion::V3 {
        points.push(
            "Arrays have one row per particle. Read and set large ones through a buffer, not a list: in \
             Python, fmpy_arrays.py in the folder documentation does so."
                .to_owned(),
        );
    } else {
        points.push(
            "Fields of the whole body and large arrays are in the FMI 3.0 export of the same scene."
                .to_owned(),
        );
    }
    xml.create_element("ul")
        .write_inner_content(|xml| points.iter().try_for_each(|point| text(xml, "li", point)))?;
    text(xml, "p", "With FMPy:")?;
    let end = simulation.scene().time.end;
    let reported: Vec<String> = table
        .variables
        .iter()
        .filter(|v| matches!(v.slot, Slot::Output(_)) && v.particles.is_none())
        .take(3)
        .map(|v| match table.version {
            FmiVersion::V2 => format!("{:?}", v.element_name(0)),
            FmiVersion::V3 => format!("{:?}", v.name),
        })
        .collect();
    text(
        xml,
        "pre",
        &format!(
            "from fmpy import simulate_fmu\nresult = simulate_fmu(\"model.fmu\", stop_time={end:?}, \
             output=[{}])",
            reported.join(", ")
        ),
    )
}

fn variables(xml: &mut Xml, table: &Table) -> io::Result<()> {
    let role = |slot, fixed| match slot {
        Slot::Time => "time",
        Slot::Parameter(_) => "parameter",
        Slot::Input(_) => "input",
        Slot::Output(_) if fixed => "constant of the geometry",
        Slot::Output(_) => "output",
    };
    xml.create_element("table").write_inner_content(|xml| {
        xml.create_element("tr").write_inner_content(|xml| {
            for heading in [
                "Name",
                "Role",
                "Unit",
                "Shape",
                "Value reference",
                "Meaning",
            ] {
                text(xml, "th", heading)?;
            }
            Ok(())
        })?;
        for v in &table.variables {
            let shape: Vec<_> = v.dimensions().iter().map(usize::to_string).collect();
            let last = v.reference as usize + v.len() - 1;
            let references = if table.version == FmiVersion::V3 || v.len() == 1 {
                v.reference.to_string()
            } else {
                format!("{} to {last}", v.reference)
            };
            xml.create_element("tr").write_inner_content(|xml| {
                xml.create_element("td")
                    .write_inner_content(|xml| text(xml, "code", &v.name))?;
                text(xml, "td", role(v.slot, v.fixed))?;
                text(xml, "td", v.unit)?;
                text(xml, "td", &shape.join(" x "))?;
                text(xml, "td", &references)?;
                text(xml, "td", &v.description)
            })?;
        }
        Ok(())
    })?;
    Ok(())
}
