//! The text of a scene: its syntax, its shape, overrides, expressions and values in time.

use urlsph::Code::{InvalidArgument as A, InvalidScene as S, Parse as P};
use urlsph::scene::{Scalar, Table, Vector};

use crate::catalogue::{Entry, entry};

const DAMAGED: &str = "Compare with the examples or with the schema (`urlsph schema`).";

pub fn entries() -> Vec<Entry> {
    [syntax(), shapes(), overrides(), expressions(), values()]
        .into_iter()
        .flatten()
        .collect()
}

fn syntax() -> Vec<Entry> {
    vec![
        entry(
            P,
            "",
            "the scene is not valid JSON: <reason>",
            "The text breaks the grammar of JSON; the reason ends with line and column.",
            "Correct the text at that line and column.",
        )
        .variants(&[
            "duplicate key `<key>`",
            ": JSON has no NaN and no Infinity, numbers are finite",
        ])
        .json("{", "")
        .json(r#"{"time": {"end": NaN}}"#, "")
        .json(r#"{"time": {"end": 1}, "time": {"end": 2}}"#, ""),
        entry(
            P,
            "path?",
            "a number is not finite",
            "A number of the scene is infinite or not a number.",
            "Give a finite number.",
        )
        .untested(
            "The reader of JSON refuses such numbers before (number out of range), and its numbers \
             cannot hold one.",
        ),
    ]
}

fn shapes() -> Vec<Entry> {
    vec![
        entry(
            P,
            "path",
            "unknown key `<key>`, expected <keys>",
            "The scene has no such key here: a slip of the pen, or a key of another section.",
            "Use one of the keys that are listed.",
        )
        .scene(&["geometry.box.spacin=1"], "geometry.box.spacin"),
        entry(
            P,
            "path?",
            "missing key `<key>`",
            "A key that has no default is not there.",
            "Add it.",
        )
        .scene(&["time={}"], "time")
        .json("{}", ""),
        entry(
            P,
            "path",
            "unknown word `<word>`, expected <words>",
            "A value is one of few words, and this is none of them.",
            "Use one of the words that are listed.",
        )
        .scene(&["numerics.precision=half"], "numerics.precision"),
        entry(
            P,
            "path?",
            "invalid type: <found>, expected <wanted>",
            "The value is of another type, such as a text instead of a number.",
            "Give what is expected.",
        )
        .variants(&["an object with keys among <keys>", "one of <words>"])
        .scene(&["time.end=soon"], "time.end")
        .scene(&["time=[3]"], "time")
        .scene(&["numerics.reference_update=3"], "numerics.reference_update")
        .json("[]", ""),
        entry(
            P,
            "path",
            "invalid value: <found>, expected <wanted>",
            "A number is out of the range of its type, such as -1 divisions.",
            "Give what is expected.",
        )
        .scene(&["numerics.neighbours=300"], "numerics.neighbours"),
        entry(
            P,
            "path",
            "invalid length <count>, expected a list of 3",
            "A vector has another number of components.",
            "Give three.",
        )
        .scene(&["probes.p=[1, 2]"], "probes.p"),
        entry(
            P,
            "path",
            "this word needs a value, expected <wanted>",
            "A choice that is an object was given as a word.",
            "Give an object with the word as its key.",
        )
        .scene(&["numerics.reference_update=every"], "numerics.reference_update.every"),
        entry(
            P,
            "path",
            "the object is empty, expected one of <words>",
            "An object that makes a choice has no key.",
            "Give it one of the keys that are listed.",
        )
        .scene(&["geometry={}"], "geometry"),
        entry(
            P,
            "path",
            "only one of <words> is possible, here are <keys>",
            "An object that makes a choice has several keys.",
            "Leave one of them.",
        )
        .scene(&["geometry.sphere={}"], "geometry"),
        entry(
            P,
            "path",
            "expected exactly one of the keys `table` and `external`",
            "A value that is an object is neither a table in time nor driven from outside.",
            "Give one of the two keys.",
        )
        .scene(&["boundary.y_max.pressure={}"], "boundary.y_max.pressure"),
        entry(
            P,
            "path",
            "`per_particle` belongs to `external`, not to `table`",
            "A table in time has one value for a whole patch.",
            "Leave `per_particle` out, or drive the value from outside.",
        )
        .scene(
            &[r#"boundary.y_max.pressure={"table": {"time": [0], "value": [1]}, "per_particle": true}"#],
            "boundary.y_max.pressure",
        ),
        entry(
            S,
            "path",
            "a text must not contain the character U+0000: remove it",
            "A name or the title would end too early in C.",
            DAMAGED,
        )
        .unit("src/ffi/tests.rs", "what_is_wrong_with_a_call_is_told_with_the_remedy"),
    ]
}

fn overrides() -> Vec<Entry> {
    let wrong = |text: &str, cause, remedy| {
        entry(
            A,
            "",
            format!("override `<override>`: {text}"),
            cause,
            remedy,
        )
    };
    vec![
        wrong(
            "expected `path=value`, such as `geometry.box.spacing=0.125`",
            "The override has no `=`.",
            "Write the path, `=` and the value.",
        )
        .scene(&["time.end"], ""),
        wrong(
            "the path is empty",
            "Nothing stands before the `=`.",
            "Write the path before it.",
        )
        .scene(&["=1"], ""),
        wrong(
            "the path has more than <count> steps",
            "No value of a scene is as deep.",
            "Correct the path.",
        )
        .call("a path of 33 steps", || {
            let long = format!("{}=1", vec!["a"; 33].join("."));
            urlsph::Scene::from_json(crate::common::BLOCK, &[long])
        }),
        wrong(
            "<place> is <kind>, it has no key `<key>`",
            "The path goes on behind a value that is no object.",
            "Shorten the path, or set the value as a whole.",
        )
        .variants(&["a number"])
        .scene(&["time.end.seconds=1"], ""),
        wrong(
            "<place> has <count> elements, counted from 0: there is no [<index>]",
            "The list is shorter.",
            "Give an index below the number of elements, or set the list as a whole.",
        )
        .scene(&["geometry.box.min[3]=1"], ""),
        wrong(
            "<place> is <kind>, it has no element [<index>]; set it as a whole: `<place>=[...]`",
            "The value is no list, or is not there.",
            "Set the whole list.",
        )
        .scene(&["boundary.y_max.velocity[1]=5"], ""),
        wrong(
            "`<path>` has no closing `\"]`",
            "A key in quotes does not end.",
            "Write it as [\"key\"].",
        )
        .scene(&["boundary[\"a.b=1"], ""),
        wrong(
            "`<path>` has no closing `]`",
            "An index does not end.",
            "Write it as [0].",
        )
        .scene(&["geometry.box.min[0=1"], ""),
        wrong(
            "`[<index>]` is not an index such as `[0]`",
            "An index is a whole number, 0 or more.",
            "Write it as [0]; a key with dots in it as [\"key\"].",
        )
        .scene(&["geometry.box.min[x]=1"], ""),
        wrong(
            "expected `.` or `[` instead of `<rest>`",
            "Something stands behind an index.",
            "Separate the steps of the path by dots.",
        )
        .scene(&["geometry.box.min[0]1=1"], ""),
        wrong(
            "a name is missing after `<path>`",
            "The path has two dots in a row, or ends with one.",
            "Correct the path.",
        )
        .scene(&["time..end=1"], ""),
    ]
}

fn expressions() -> Vec<Entry> {
    let inside = |text: &str, cause, remedy| {
        entry(
            S,
            "path boundary?",
            format!("in the expression `<expression>`: {text}"),
            cause,
            remedy,
        )
    };
    const PATH: &str = "boundary.y_max.pressure";
    vec![
        entry(
            S,
            "path boundary?",
            "an expression has at most <count> characters; use a table",
            "A scene is data and not a program.",
            "Give the values as a table in time, or drive them from outside.",
        )
        .call("5000 characters", || {
            let long = format!("boundary.y_max.pressure={}", "t+".repeat(2500));
            urlsph::Scene::from_json(crate::common::BLOCK, &[long])
        }),
        inside(
            "it ends where <wanted> is expected",
            "The expression is not complete.",
            "Add what is expected.",
        )
        .variants(&["a number, a name or `(`"])
        .scene(&["boundary.y_max.pressure=X +"], PATH),
        inside(
            "expected <wanted> instead of `<character>` at character <place>",
            "The expression breaks the rules of arithmetic there, such as 2X instead of 2*X.",
            "Write what is expected.",
        )
        .variants(&["an operator", "`)`", "`(` after the function <function>"])
        .scene(&["boundary.y_max.pressure=2X"], PATH)
        .scene(&["boundary.y_max.pressure=(2]"], PATH)
        .scene(&["boundary.y_max.pressure=sin X"], PATH),
        inside(
            "it is nested more than <count> levels deep",
            "So many parentheses, signs or powers are no formula.",
            "Simplify it, or use a table.",
        )
        .call("100 parentheses", || {
            let deep = format!("boundary.y_max.pressure={}", "(".repeat(100));
            urlsph::Scene::from_json(crate::common::BLOCK, &[deep])
        }),
        inside(
            "`**` at character <place>: a power is written with `^`",
            "`**` is a power in Python and Fortran.",
            "Write `^`.",
        )
        .scene(&["boundary.y_max.pressure=X**2"], PATH),
        inside(
            "`<number>` at character <place> is not a finite number",
            "The number is too large for double precision, or has no digits.",
            "Correct it.",
        )
        .scene(&["boundary.y_max.pressure=X+1e999"], PATH),
        inside(
            "unknown name `<name>` at character <place>; known are X, Y, Z (initial position), t (time), \
             pi, e and the functions <functions>",
            "Variables are X, Y, Z and t, with these letters' case.",
            "Use a name of the list.",
        )
        .scene(&["boundary.y_max.pressure=x"], PATH),
        inside(
            "the function <name> takes <count> argument<s>, not <given>",
            "A function has another number of arguments.",
            "Give as many as it takes.",
        )
        .scene(&["boundary.y_max.pressure=max(X)"], PATH),
        inside(
            "<reason of the evaluator>",
            "The evaluator refuses what the grammar has let through.",
            "Report it with the expression: it is a bug.",
        )
        .untested(
            "The grammar hands the evaluator nothing but what it accepts; random expressions \
             (`tests/scene.rs`) find no exception.",
        ),
        entry(
            S,
            "path boundary?",
            "the expression `<expression>` is <value>, not a finite number",
            "An expression without variables divides by zero or overflows.",
            "Correct it.",
        )
        .scene(&["boundary.y_max.pressure=1/0"], PATH),
    ]
}

fn values() -> Vec<Entry> {
    const TABLE: &str = "boundary.y_max.pressure.table";
    vec![
        entry(
            S,
            "path boundary?",
            "expected a finite number instead of <value>",
            "A number is infinite or not a number, which only a scene made in code can hold.",
            "Give a finite number.",
        )
        .call("a coordinate", || {
            let mut scene = crate::scene();
            scene.probes.insert("p".into(), [f64::NAN; 3]);
            scene.validate()
        })
        .call("a component from outside", || {
            let mut scene = crate::scene();
            scene.body_force = Some(Vector::External {
                external: [0.0, f64::INFINITY, 0.0],
                per_particle: false,
            });
            scene.validate()
        })
        .call("a component", || {
            let mut scene = crate::scene();
            let nan = || Some(Scalar::Constant(f64::NAN));
            scene.body_force = Some(Vector::Components([nan(), nan(), nan()]));
            scene.validate()
        }),
        entry(
            S,
            "path boundary?",
            "a table needs at least one time",
            "The table is empty.",
            "Give a list of times and one of values, equally long.",
        )
        .scene(
            &[r#"boundary.y_max.pressure={"table": {"time": [], "value": []}}"#],
            "boundary.y_max.pressure.table.time",
        ),
        entry(
            S,
            "path boundary?",
            "a table has one value per time: here are <count> times and <count> values",
            "The two lists differ in length.",
            "Add what is missing.",
        )
        .scene(
            &[r#"boundary.y_max.pressure={"table": {"time": [0, 1], "value": [0]}}"#],
            "boundary.y_max.pressure.table.value",
        ),
        entry(
            S,
            "path boundary?",
            "the times of a table increase strictly, but <time> follows <time>",
            "Times are out of order or there twice.",
            "Sort them; for a jump give two times that differ a little.",
        )
        .scene(
            &[r#"boundary.y_max.pressure={"table": {"time": [0, 0], "value": [0, 1]}}"#],
            "boundary.y_max.pressure.table.time[1]",
        ),
        entry(
            S,
            "path boundary?",
            "expected a finite time instead of <time>",
            "A time of a table is infinite or not a number, which only a scene made in code can hold.",
            "Give a finite time.",
        )
        .call(TABLE, || crate::with_table(f64::NAN, 0.0)),
        entry(
            S,
            "path boundary?",
            "expected finite numbers instead of <values>",
            "A value of a table is infinite or not a number, which only a scene made in code can hold.",
            "Give finite values.",
        )
        .call(TABLE, || crate::with_table(0.0, f64::NAN)),
        entry(
            S,
            "path boundary?",
            "a component cannot be external by itself; make the whole vector external: {\"external\": [x, y, z]}",
            "Inputs from outside are whole vectors.",
            "Make the whole vector external.",
        )
        .scene(
            &[r#"boundary.y_max.traction=[0, {"external": 1}, 0]"#],
            "boundary.y_max.traction[1]",
        ),
    ]
}

/// A table of one entry, for the tests of numbers that JSON cannot hold.
pub fn table(time: f64, value: f64) -> Scalar {
    Scalar::Table {
        table: Table {
            time: vec![time],
            value: vec![value],
        },
    }
}
