//! Expressions in X, Y, Z and t, with the precedence of mathematics.
//!
//! `exmex` evaluates; it reads `-X^2` as `(-X)^2`, `2^3^2` from the left and no `5e-7`. The small
//! grammar here reads the text as a mathematician does and hands `exmex` an unambiguous form of it:
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = factor { ("*" | "/") factor }
//! factor  = ("-" | "+") factor | power
//! power   = primary [ "^" factor ]
//! primary = number | name | name "(" sum { "," sum } ")" | "(" sum ")"
//! ```

use exmex::{BinOp, Express, FlatEx, MakeOperators, Operator};

/// Longest expression [characters]: a scene is data, not a program.
const MAX_LENGTH: usize = 4000;
/// Deepest nesting of parentheses, signs and powers: it bounds the recursion of the parser.
const MAX_DEPTH: usize = 60;

/// Variables in the order in which `exmex` sorts them.
const VARIABLES: [&str; 4] = ["X", "Y", "Z", "t"];

const CONSTANTS: [(&str, f64); 4] = [
    ("pi", std::f64::consts::PI),
    ("PI", std::f64::consts::PI),
    ("e", std::f64::consts::E),
    ("E", std::f64::consts::E),
];

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

/// Functions of one argument.
const UNARY: [(&str, Unary); 16] = [
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("sqrt", f64::sqrt),
    ("abs", f64::abs),
    ("floor", f64::floor),
    ("heaviside", heaviside),
];

/// Functions of two arguments.
const BINARY: [(&str, Binary); 4] = [
    ("min", min),
    ("max", max),
    ("atan2", f64::atan2),
    ("pow", f64::powf),
];

/// 0 before 0, 1 from 0 on: a load that starts at t0 is `heaviside(t - t0) * ...`.
fn heaviside(x: f64) -> f64 {
    if x.is_nan() {
        x
    } else if x < 0.0 {
        0.0
    } else {
        1.0
    }
}

/// Not `f64::min`, which would hide a NaN.
fn min(a: f64, b: f64) -> f64 {
    if a.is_nan() || a < b { a } else { b }
}

fn max(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The operators that `exmex` knows; the grammar has resolved all precedence but that of a chain.
#[derive(Clone, Debug)]
struct Operators;

impl MakeOperators<f64> for Operators {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        let binary = |apply: Binary, prio| BinOp {
            apply,
            prio,
            is_commutative: false,
        };
        let mut operators = vec![
            Operator::make_bin("+", binary(|a, b| a + b, 0)),
            Operator::make_bin_unary("-", binary(|a, b| a - b, 0), |a| -a),
            Operator::make_bin("*", binary(|a, b| a * b, 1)),
            Operator::make_bin("/", binary(|a, b| a / b, 1)),
            Operator::make_bin("^", binary(f64::powf, 2)),
        ];
        operators.extend(UNARY.map(|(name, f)| Operator::make_unary(name, f)));
        operators.extend(BINARY.map(|(name, f)| Operator::make_bin(name, binary(f, 2))));
        operators
    }
}

/// A compiled expression.
#[derive(Debug, Clone)]
pub struct Expression {
    /// Boxed: `exmex` keeps room for 32 operators, 20 kB, in line.
    program: Box<FlatEx<f64, Operators>>,
    /// Indices into [`VARIABLES`] of the `count` variables that occur, ascending.
    used: [u8; 4],
    count: usize,
}

impl Expression {
    /// Compiles a text; the error says what is wrong and at which character.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.chars().count() > MAX_LENGTH {
            return Err(format!(
                "an expression has at most {MAX_LENGTH} characters; use a table"
            ));
        }
        let mut parser = Parser {
            text,
            at: 0,
            depth: 0,
        };
        let canonical = parser
            .sum()
            .and_then(|c| match parser.peek() {
                None => Ok(c),
                Some(_) => Err(parser.unexpected("an operator")),
            })
            .map_err(|message| format!("in the expression `{text}`: {message}"))?;
        // Constants are not folded: what is evaluated is what was written, in that order.
        let program = FlatEx::<f64, Operators>::parse_wo_compile(&canonical)
            .map_err(|e| format!("in the expression `{text}`: {}", e.msg()))?;
        let mut used = [0; 4];
        for (slot, name) in used.iter_mut().zip(program.var_names()) {
            let index = VARIABLES.iter().position(|v| v == name);
            *slot = index.expect("the grammar lets only VARIABLES through") as u8;
        }
        let count = program.var_names().len();
        Ok(Self {
            program: Box::new(program),
            used,
            count,
        })
    }

    /// The value at initial position `x` and time `t`; not finite where the expression is not.
    pub fn eval(&self, x: [f64; 3], t: f64) -> f64 {
        let all = [x[0], x[1], x[2], t];
        let values = self.used.map(|i| all[i as usize]);
        self.program
            .eval(&values[..self.count])
            .expect("the number of values is the number of variables")
    }

    /// Whether X, Y or Z occurs.
    pub fn depends_on_space(&self) -> bool {
        self.used[..self.count].iter().any(|&i| i < 3)
    }

    /// Whether t occurs.
    pub fn depends_on_time(&self) -> bool {
        self.used[..self.count].contains(&3)
    }
}

/// Recursive descent over the text; every method returns the form for `exmex`.
struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    /// The next character that is not blank.
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        let blank = rest.len() - rest.trim_start().len();
        self.at += blank;
        rest.trim_start().chars().next()
    }

    fn accept(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.at += wanted.len_utf8();
        }
        found
    }

    fn place(&self) -> usize {
        self.text[..self.at].chars().count() + 1
    }

    fn unexpected(&mut self, wanted: &str) -> String {
        match self.peek() {
            None => format!("it ends where {wanted} is expected"),
            Some(c) => format!(
                "expected {wanted} instead of `{c}` at character {}",
                self.place()
            ),
        }
    }

    fn nested<T>(&mut self, f: impl FnOnce(&mut Self) -> Result<T, String>) -> Result<T, String> {
        if self.depth == MAX_DEPTH {
            return Err(format!("it is nested more than {MAX_DEPTH} levels deep"));
        }
        self.depth += 1;
        let result = f(self);
        self.depth -= 1;
        result
    }

    fn chain(
        &mut self,
        operators: [char; 2],
        operand: fn(&mut Self) -> Result<String, String>,
    ) -> Result<String, String> {
        let mut chain = operand(self)?;
        let mut links = 0;
        while let Some(c) = self.peek().filter(|c| operators.contains(c)) {
            self.at += c.len_utf8();
            if c == '*' && self.peek() == Some('*') {
                return Err(format!(
                    "`**` at character {}: a power is written with `^`",
                    self.place() - 1
                ));
            }
            chain.push(c);
            chain += &operand(self)?;
            links += 1;
        }
        Ok(if links > 0 {
            format!("({chain})")
        } else {
            chain
        })
    }

    fn sum(&mut self) -> Result<String, String> {
        self.chain(['+', '-'], Self::product)
    }

    fn product(&mut self) -> Result<String, String> {
        self.chain(['*', '/'], Self::factor)
    }

    fn factor(&mut self) -> Result<String, String> {
        if self.accept('-') {
            Ok(format!("(-{})", self.nested(Self::factor)?))
        } else if self.accept('+') {
            self.nested(Self::factor)
        } else {
            let base = self.primary()?;
            if self.accept('^') {
                Ok(format!("({base}^{})", self.nested(Self::factor)?))
            } else {
                Ok(base)
            }
        }
    }

    fn primary(&mut self) -> Result<String, String> {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                let inner = self.nested(Self::sum)?;
                if self.accept(')') {
                    Ok(inner)
                } else {
                    Err(self.unexpected("`)`"))
                }
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.named(),
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    fn number(&mut self) -> Result<String, String> {
        let bytes = self.text.as_bytes();
        let digits = |mut i: usize| {
            while bytes.get(i).is_some_and(u8::is_ascii_digit) {
                i += 1;
            }
            i
        };
        let mut end = digits(self.at);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            if bytes.get(end + 1 + sign).is_some_and(u8::is_ascii_digit) {
                end = digits(end + 1 + sign);
            }
        }
        let literal = &self.text[self.at..end];
        let place = self.place();
        self.at = end;
        match literal.parse::<f64>() {
            // `{}` writes all digits without an exponent, which `exmex` does not read.
            Ok(value) if value.is_finite() => Ok(format!("{value}")),
            _ => Err(format!(
                "`{literal}` at character {place} is not a finite number"
            )),
        }
    }

    fn named(&mut self) -> Result<String, String> {
        let rest = &self.text[self.at..];
        let end = rest
            .find(|c: char| !(c.is_alphanumeric() || c == '_'))
            .unwrap_or(rest.len());
        let (name, place) = (&rest[..end], self.place());
        self.at += end;
        let unary = UNARY.iter().any(|(n, _)| *n == name);
        let binary = BINARY.iter().any(|(n, _)| *n == name);
        if unary || binary {
            return self.call(name, if unary { 1 } else { 2 });
        }
        if VARIABLES.contains(&name) {
            return Ok(name.to_owned());
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(n, _)| *n == name) {
            return Ok(format!("{value}"));
        }
        let functions = UNARY
            .iter()
            .map(|(n, _)| *n)
            .chain(BINARY.iter().map(|(n, _)| *n));
        Err(format!(
            "unknown name `{name}` at character {place}; known are X, Y, Z (initial position), t (time), pi, e and the functions {}",
            functions.collect::<Vec<_>>().join(", ")
        ))
    }

    fn call(&mut self, name: &str, arity: usize) -> Result<String, String> {
        if !self.accept('(') {
            return Err(self.unexpected(&format!("`(` after the function {name}")));
        }
        let mut arguments = vec![self.nested(Self::sum)?];
        while self.accept(',') {
            arguments.push(self.nested(Self::sum)?);
        }
        if !self.accept(')') {
            return Err(self.unexpected("`)`"));
        }
        match &arguments[..] {
            [a] if arity == 1 => Ok(format!("({name}({a}))")),
            [a, b] if arity == 2 => Ok(format!("(({a}) {name} ({b}))")),
            _ => Err(format!(
                "the function {name} takes {arity} argument{}, not {}",
                if arity == 1 { "" } else { "s" },
                arguments.len()
            )),
        }
    }
}
