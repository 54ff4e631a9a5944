//! The places in the source that make errors: the texts in them, found in the syntax tree.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Expr, ExprLit, ItemFn, ItemMod, Lit, LitStr, Macro, Pat, Token};

/// A text of an error; `\0` stands for what is filled in.
pub struct Site {
    pub file: String,
    pub line: usize,
    pub text: String,
}

#[derive(Default)]
pub struct Found {
    pub messages: Vec<Site>,
    /// `file: function` of the places that make an error from a text that they are given.
    pub silent: BTreeSet<String>,
}

/// Functions that make an error from a text, by the last part of their name.
const MAKERS: [&str; 11] = [
    "Err", "argument", "at_least", "custom", "damaged", "error", "failed", "new", "require",
    "scene", "wrong",
];
/// Methods whose argument is an error or a text of one.
const METHODS: [&str; 7] = [
    "map_err",
    "ok_or",
    "ok_or_else",
    "pilot",
    "unexpected",
    "with_note",
    "wrong",
];
/// Constants with texts of errors.
const CONSTANTS: [&str; 2] = ["NOT_CO_SIMULATION", "WANTED"];

/// Functions that return the text of an error.
const SAYERS: [&str; 1] = ["unexpected"];

/// Entries whose text comes from the reader of JSON or stands around an error.
pub const MADE_OTHERWISE: [&str; 8] = [
    "unknown key `<key>`, expected <keys>",
    "missing key `<key>`",
    "unknown word `<word>`, expected <words>",
    "invalid value: <found>, expected <wanted>",
    "invalid length <count>, expected a list of 3",
    "this word needs a value, expected <wanted>",
    "instantiation failed: <error>",
    "in <file>",
];
/// Places that hand a text on; the text itself is found where it is written.
pub const HANDED_ON: [&str; 7] = [
    "src/reference/mod.rs: new",
    "src/scene/geometry.rs: read_file",
    "src/scene/mod.rs: from_file",
    "src/scene/parse.rs: apply",
    "src/scene/parse.rs: typed",
    "src/scene/value.rs: compile",
    "src/scene/value.rs: new",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources() -> Vec<PathBuf> {
    let mut folders = vec![root().join("src"), root().join("fmu")];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if name.ends_with(".rs") && name != "tests.rs" {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// All texts of errors in the library, the FMU and the command line, without their tests.
pub fn all() -> Found {
    let mut found = Found::default();
    for path in sources() {
        let tree = syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap();
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        let mut scan = Scan {
            file: &file,
            function: String::new(),
            locals: BTreeMap::new(),
            followed: BTreeSet::new(),
            inside: 0,
            found: &mut found,
        };
        scan.visit_file(&tree);
    }
    found
        .messages
        .sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
    found
        .messages
        .dedup_by(|a, b| (&a.file, a.line, &a.text) == (&b.file, b.line, &b.text));
    found
}

/// The literals of a unit test.
pub fn literals_of_test(file: &str, name: &str) -> Vec<String> {
    struct Literals<'a> {
        name: &'a str,
        inside: bool,
        texts: Vec<String>,
    }
    impl<'ast> Visit<'ast> for Literals<'_> {
        fn visit_item_fn(&mut self, f: &'ast ItemFn) {
            let before = self.inside;
            self.inside |= f.sig.ident == self.name;
            visit::visit_item_fn(self, f);
            self.inside = before;
        }
        fn visit_lit_str(&mut self, text: &'ast LitStr) {
            if self.inside {
                self.texts.push(fixed(&text.value()).replace("{{", "{"));
            }
        }
        fn visit_macro(&mut self, m: &'ast Macro) {
            for expression in arguments(m) {
                self.visit_expr(&expression);
            }
        }
    }
    let tree = syn::parse_file(&fs::read_to_string(root().join(file)).unwrap()).unwrap();
    let mut literals = Literals {
        name,
        inside: false,
        texts: Vec::new(),
    };
    literals.visit_file(&tree);
    literals.texts
}

fn arguments(m: &Macro) -> Vec<Expr> {
    let list = Punctuated::<Expr, Token![,]>::parse_terminated;
    let parsed = list.parse2(m.tokens.clone());
    parsed.map_or(Vec::new(), |all| all.into_iter().collect())
}

/// A format text with `\0` for what is filled in.
fn fixed(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(at) = rest.find(['{', '}']) {
        out += &rest[..at];
        let here = &rest[at..];
        rest = if here.starts_with("{{") || here.starts_with("}}") {
            out += &here[..1];
            &here[2..]
        } else if let (true, Some(end)) = (here.starts_with('{'), here.find('}')) {
            out.push('\0');
            &here[end + 1..]
        } else {
            out += &here[..1];
            &here[1..]
        };
    }
    out + rest
}

/// The names that a format text fills in by itself.
fn captured(text: &str) -> Vec<String> {
    let names = text
        .split('{')
        .skip(1)
        .filter_map(|rest| rest.split(['}', ':']).next());
    names.filter(|n| !n.is_empty()).map(str::to_owned).collect()
}

struct Scan<'a> {
    file: &'a str,
    function: String,
    /// What the variables of the present function are.
    locals: BTreeMap<String, Vec<Expr>>,
    followed: BTreeSet<String>,
    /// How many makers of errors are around.
    inside: usize,
    found: &'a mut Found,
}

/// The variables of a function with what they are set to.
struct Locals(BTreeMap<String, Vec<Expr>>);

impl<'ast> Visit<'ast> for Locals {
    fn visit_local(&mut self, local: &'ast syn::Local) {
        struct Names(Vec<String>);
        impl<'ast> Visit<'ast> for Names {
            fn visit_pat_ident(&mut self, p: &'ast syn::PatIdent) {
                self.0.push(p.ident.to_string());
            }
        }
        let mut names = Names(Vec::new());
        names.visit_pat(&local.pat);
        if let (Some(init), false) = (&local.init, matches!(local.pat, Pat::Wild(_))) {
            for name in names.0 {
                self.0.entry(name).or_default().push((*init.expr).clone());
            }
        }
        visit::visit_local(self, local);
    }
}

impl Scan<'_> {
    fn text(&mut self, text: &str, line: usize) {
        if self.inside == 0 {
            return;
        }
        for name in captured(text) {
            self.follow(&name);
        }
        let text = fixed(text);
        // Names, keys and formats are no messages.
        let words = text
            .split_whitespace()
            .filter(|w| w.chars().any(char::is_alphabetic));
        if words.count() >= 2 {
            self.found.messages.push(Site {
                file: self.file.to_owned(),
                line,
                text,
            });
        }
    }

    /// Looks at what a variable is.
    fn follow(&mut self, name: &str) {
        if self.followed.insert(name.to_owned()) {
            for expression in self.locals.get(name).cloned().unwrap_or_default() {
                self.visit_expr(&expression);
            }
        }
    }

    fn function(&mut self, name: &syn::Ident, block: &syn::Block, go: impl FnOnce(&mut Self)) {
        let mut locals = Locals(BTreeMap::new());
        locals.visit_block(block);
        let function = std::mem::replace(&mut self.function, name.to_string());
        let locals = std::mem::replace(&mut self.locals, locals.0);
        let followed = std::mem::take(&mut self.followed);
        let says = SAYERS.iter().any(|sayer| name == sayer);
        self.maker(says, go);
        (self.function, self.locals, self.followed) = (function, locals, followed);
    }

    fn maker(&mut self, is: bool, go: impl FnOnce(&mut Self)) {
        self.inside += usize::from(is);
        go(self);
        self.inside -= usize::from(is);
    }
}

impl<'ast> Visit<'ast> for Scan<'_> {
    fn visit_item_mod(&mut self, m: &'ast ItemMod) {
        if m.ident != "tests" {
            visit::visit_item_mod(self, m);
        }
    }
    fn visit_item_fn(&mut self, f: &'ast ItemFn) {
        self.function(&f.sig.ident, &f.block, |scan| visit::visit_item_fn(scan, f));
    }
    fn visit_impl_item_fn(&mut self, f: &'ast syn::ImplItemFn) {
        self.function(&f.sig.ident, &f.block, |scan| {
            visit::visit_impl_item_fn(scan, f)
        });
    }
    fn visit_item_const(&mut self, c: &'ast syn::ItemConst) {
        let is = CONSTANTS.iter().any(|name| c.ident == name);
        self.maker(is, |scan| visit::visit_item_const(scan, c));
    }
    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        let Expr::Path(path) = &*call.func else {
            return visit::visit_expr_call(self, call);
        };
        let names: Vec<String> = path
            .path
            .segments
            .iter()
            .map(|s| s.ident.to_string())
            .collect();
        let last = names.last().map_or("", String::as_str);
        if last == "io_error" {
            return;
        }
        let of_error = names.len() > 1 && names[names.len() - 2] == "Error";
        let is = of_error || MAKERS.contains(&last) && last != "new" && last != "scene";
        let before = self.found.messages.len();
        let followed = self.followed.len();
        self.maker(is, |scan| visit::visit_expr_call(scan, call));
        let silent = self.found.messages.len() == before && self.followed.len() == followed;
        if of_error && silent && matches!(last, "new" | "scene" | "argument" | "custom") {
            self.found
                .silent
                .insert(format!("{}: {}", self.file, self.function));
        }
    }
    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        self.visit_expr(&call.receiver);
        if call.method == "expect" {
            return;
        }
        let literal = matches!(call.args.first(), Some(Expr::Lit(_)));
        let is =
            METHODS.iter().any(|name| call.method == name) || call.method == "then_some" && literal;
        self.maker(is, |scan| call.args.iter().for_each(|a| scan.visit_expr(a)));
    }
    fn visit_expr_path(&mut self, path: &'ast syn::ExprPath) {
        if let (true, Some(name)) = (self.inside > 0, path.path.get_ident()) {
            self.follow(&name.to_string());
        }
    }
    fn visit_expr_lit(&mut self, literal: &'ast ExprLit) {
        if let Lit::Str(text) = &literal.lit {
            self.text(&text.value(), text.span().start().line);
        }
    }
    fn visit_macro(&mut self, m: &'ast Macro) {
        let name = m.path.segments.last().map(|s| s.ident.to_string());
        let shows = ["format", "format_args"]
            .iter()
            .any(|n| name.as_deref() == Some(n));
        if shows || name.as_deref() == Some("vec") || name.as_deref() == Some("matches") {
            for expression in arguments(m) {
                self.visit_expr(&expression);
            }
        }
    }
}
