"""Model files that mean harm: each is refused in one line within seconds, or handled.

Every file is checked in a process of its own, which may have so much memory and so much time.
"""

import json
import os
import sys

import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sklearn_pgnn.cli import main

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="a process has limits on Linux"),
]
#: memory beyond what the tests have themselves [byte], and time on a core [s]: 300 terms and their
#: 36 other signs are compiled in 15 s where nothing else runs, and in twice that on a busy machine
MEMORY, SECONDS = 2_000_000_000, 90
#: longest line of an error [characters]
LINE = 3000
RECORD = "t,F,x,v\n" + "".join(
    f"{k / 50},{k % 3 - 1},{(k % 9) / 9},{(k % 7) / 7}\n" for k in range(60)
)

# -- equations -------------------------------------------------------------------------------------

count = st.sampled_from([3, 40, 61, 300, 3000])
number = st.sampled_from(
    ["0", "1", "-1", "0.1", "99", "100", "101", "1e308", "1e-320", "1e400", "9" * 400, "0x10", "1j"]
)
leaf = st.sampled_from(["x", "v", "F", "k", "t", "pi"]) | number
binary = st.sampled_from(["+", "-", "*", "/", "**", "//", "%", "@", "^", "<", " if x else ", ","])
function = st.sampled_from(
    ["abs", "sqrt", "log", "exp", "tan", "asin", "sign", "floor", "max", "atan2", "eval", "x", "k."]
)
arithmetic = st.recursive(
    leaf,
    lambda part: (
        st.builds("({}{}{})".format, part, binary, part)
        | st.builds("{}({})".format, function, part)
        | st.builds("({})**{}".format, part, number)
    ),
    max_leaves=12,
)
nested = st.builds(
    lambda n, kind: kind.replace("#", "x") if n == 0 else _nest(kind, n),
    count,
    st.sampled_from(["(#)", "-#", "sin(#)", "(#)**2", "1/(1+#)", "max(#,1)", "abs(#-v)"]),
)
tower = st.builds(
    "(((x+v+1)**{}+(x-v)**{})**{}+k)**{}".format,
    *[st.sampled_from([2, 9, 33, 99]) for _ in range(4)],
)
long = st.builds(
    lambda n, term, sign: sign.join(term.replace("#", str(i)) for i in range(n)),
    count,
    st.sampled_from(["sin(#*x+v)", "(x+v+#)", "(x-#)**9", "abs(v-#)", "max(x,#)", "exp(-#*x)"]),
    st.sampled_from(["+", "*", "/", "-"]),
)
impossible = st.sampled_from(
    [
        *("1/0", "x/(k-k)", "0**-1", "log(0)", "sqrt(-1)", "asin(2)", "atan2(0,0)", "zoo", "nan"),
        *("k/0*0", "(x-x)**(v-v)", "floor(1e300*x)", "x**x**x", "(-1)**0.5", "sign(1/x)", "oo"),
        *("__import__('os')", "x.__class__", "[x for x in v]", "lambda: x", "f'{x}'", "x:=v"),
        *("x;v", "x\\nv", "", " ", "#", "x if v else F", "*x", "...", "True", "None", "ſ", "ª+x"),
        *("\\uD800", "\\u2028x", "\\0", "ｘ", "x​", "𝑥", "µ+μ"),
    ]
)
equation = arithmetic | nested | tower | long | impossible


def _nest(kind, n):
    before, after = kind.split("#")
    return (before * n + "x" + after * n)[:20_000]


def _named(text, kind, n):
    """Yield shared subexpressions, each of the one before."""
    yield f'a0: "{text}"'
    for i in range(n):
        yield f'a{i + 1}: "{kind.replace("#", f"a{i}")}"'


# -- files -----------------------------------------------------------------------------------------

WHOLE = {
    "name": "cart",
    "states": "{x: m, v: m/s}",
    "inputs": "{F: N}",
    "outputs": "{x: x, v: v}",
    "parameters": "{k: {value: 2.0, unit: N/m}}",
    "equations": '{x: v, v: "F - k*x"}',
    "inertia": "{v: 1.0}",
    "simulation": "{substeps: 2}",
}
scalar = st.sampled_from(
    [
        *("", "~", "null", "true", "0", "-1", ".nan", ".inf", "1e999", "1_000", "0o7", "x: y"),
        *("2026-01-01", "1" * 5000, "a" * 5000, '"\\uDFFF"', '"\\0"', "'x'", "[1, 2]", "{}", "[]"),
        *("!!python/object/apply:os.getcwd []", "!!binary aGk=", "!x y", "&a x", "*a", "&a [*a]"),
        *("1" + "0" * 12, "1" + "0" * 31, "0.5", "\t", "|\n  x\n", ">-\n  1\n", "{a: b}"),
        *("[.inf, -.inf]", "[1]", "[2, 1]", "[[[[1]]]]", "{value: .nan}", "{? [a] : b}"),
        *("{value: 1, bounds: [2, 3]}", "{value: 1, spread: -1}", "{value: 1, fixed: maybe}"),
    ]
)
name = st.sampled_from(
    [
        *("x", "v", "t", "pi", "sin", "class", "_x", "x y", "x.y", "1x", "é", "µ", "μ", "𝑥", "ſ"),
        *("a" * 5000, '"\\uD83D"', '"\\0"', "null", "true", "<<", "!!str q", "&k q", "?", "-"),
        *("''", "...", "---"),
    ]
)
entries = st.lists(st.tuples(name, scalar), max_size=4).map(
    lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
)
changed = st.dictionaries(
    st.sampled_from([*WHOLE, "energy", "delays", "settled", "columns", "let", "ports"]),
    scalar | entries,
    min_size=1,
    max_size=2,
)
many = st.builds(
    lambda kind, n: {kind: "{" + ", ".join(f"q{i}: 1" for i in range(n)) + "}"},
    st.sampled_from(["states", "inputs", "parameters", "outputs"]),
    count,
)
shared = st.builds(
    lambda text, kind, n: {
        "let": "{" + ", ".join(_named(text, kind, min(n, 300))) + "}",
        "equations": f'{{x: v, v: "a{min(n, 300)}"}}',
    },
    equation,
    st.sampled_from(["#", "#+1/#", "#*#", "sin(#)", "(#)**9", "#**#", "max(#,v)", "abs(#)-#"]),
    count,
)
ports = st.builds(
    lambda text, effort: {
        "ports": f"{{p: {{effort: {effort}, flow: v}}}}",
        "equations": f'{{x: v, v: "e*({text}) + F"}}',
    },
    equation,
    st.sampled_from(["e", "F", "x", "k", "p", "a.b", "''"]),
)
dangerous = (
    changed
    | many
    | shared
    | ports
    | equation.map(lambda text: {"equations": f'{{x: v, v: "{text}"}}'})
)
raw = st.sampled_from(
    [
        *(
            "",
            "\n",
            "---\n---\n",
            "%YAML 9.9\n---\nx",
            "[" * 5000,
            "{" * 5000,
            "- " * 3000,
            "? " * 3000,
        ),
        "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nstates: {*c : m}",
        "&m {states: {x: m}, equations: {x: v}, inertia: *m}",
        "base: &b {x: m}\nstates:\n  <<: *b\nequations: {x: x}",
        "states: {x: m}\nstates: {v: m}\nequations: {x: x}",
        "states: [x, x]\nequations: {x: x}",
        "states: {x: m}\nequations: {x: !!python/name:os.system }",
        "\ufeff\ufeffstates: {x: m}",
        "states: {x: m}\nequations:\n\tx: x",
        "a: " + "'" * 9999,
    ]
)
whole = dangerous.map(lambda parts: "".join(f"{k}: {v}\n" for k, v in {**WHOLE, **parts}.items()))
cut = st.builds(lambda text, share: text[: int(share * len(text))], whole, st.floats(0, 1))


# -- what comes of them ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "run.csv").write_text(RECORD)
    (folder / "model.yaml").write_text("".join(f"{k}: {v}\n" for k, v in WHOLE.items()))
    assert checked(folder)["code"] == 0  # and what is loaded first is loaded before the fork
    return folder


def checked(folder):
    """Return the exit code and the lines of `check`."""
    args = ["check", "--model", str(folder / "model.yaml"), str(folder / "run.csv"), "--quiet"]
    done = CliRunner().invoke(main, args)
    return {"code": done.exit_code, "lines": done.stderr.splitlines(), "said": str(done.exception)}


def apart(work):
    """Return what work returns in a process with limits; the signal that ended it as its code."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        limit()
        os.write(theirs, json.dumps(work()).encode())
        os._exit(0)
    os.close(theirs)
    with os.fdopen(ours, "rb") as told:
        text = told.read()
    status = os.waitpid(child, 0)[1]
    return json.loads(text) if text else {"code": -os.WTERMSIG(status), "lines": []}


def limit():
    import resource

    with open("/proc/self/statm") as file:
        here = int(file.read().split()[0]) * resource.getpagesize()
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + SECONDS
    resource.setrlimit(resource.RLIMIT_AS, (here + MEMORY, here + MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


@settings(
    max_examples=200, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck)
)
@given(text=whole | raw | cut)
def test_a_hostile_model_file_is_refused_in_one_line_or_handled(place, text):
    (place / "model.yaml").write_text(text, encoding="utf-8")
    done = apart(lambda: checked(place))
    assert done["code"] in (0, 2), done
    told = [line for line in done["lines"] if not line.startswith("Warning: ")]
    assert len(told) == (done["code"] == 2), done
    for line in done["lines"]:
        assert len(line) < LINE
        assert "memory" not in line
        assert "a bug in" not in line
