"""The page in a browser, as a person uses it: with a mouse, with keys, on a phone, at night."""

from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer
from threading import Thread

import numpy as np
import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("starlette")
from served import served


@pytest.fixture
def url():
    with served() as address:
        yield address.url


@pytest.fixture
def visit(browser, url):
    """A function that opens the page; what the browser complains of is an error."""
    opened, said = [], []

    def open_page(width=1280, scheme="light"):
        size = {"width": width, "height": 900}
        context = browser.new_context(viewport=size, color_scheme=scheme)
        context.set_default_timeout(180_000)  # [ms]; the machine may have other work
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(url)
        opened.append(context)
        return page

    yield open_page
    for context in opened:
        context.close()
    assert [text for text in said if "400 (Bad Request)" not in text] == []


def model_file(folder):
    path = folder / "model.yaml"
    path.write_text(
        "states: {v: m/s}\nequations: {v: (F - d*v)/m}\ninputs: {F: N}\n"
        "parameters: {m: 2.0, d: 0.5}\n"
    )
    return path


def record_file(folder, header="t,F,v"):
    path = folder / "run.csv"
    path.write_text(f"{header}\n" + "".join(f"{k / 10},1,{k % 7}\n" for k in range(100)))
    return path


def fits(page):
    return page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


@pytest.mark.slow
def test_the_example_is_diagnosed_with_keys_alone(visit):
    page = visit()
    page.wait_for_selector("text=Show me")
    for _ in range(9):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.textContent") == "Show me":
            break
    page.keyboard.press("Enter")
    page.wait_for_selector("#seen figure svg")
    page.focus("#diagnose")
    page.keyboard.press("Enter")
    page.wait_for_selector("#work progress")
    page.wait_for_selector("#result .verdict", timeout=300_000)
    assert "Coulomb friction on v" in page.inner_text("#result")
    with page.context.expect_page() as opening:
        page.click("#report")
    report = opening.value
    report.wait_for_selector("h1")
    assert "Coulomb friction on v" in report.title()
    with page.expect_download() as coming:
        page.click("text=extended_model.yaml")
    assert coming.value.suggested_filename == "extended_model.yaml"
    page.click("#go-on")
    page.wait_for_selector("#model :text('extended_model.yaml')")
    page.wait_for_selector("#seen figure svg")
    assert "Fc" in page.inner_text("#model")


@pytest.mark.slow
def test_a_model_is_simulated_while_it_is_written(visit):
    page = visit()
    page.click("text=Show me")
    page.wait_for_selector("#seen figure svg")
    before = page.inner_text("#seen")
    page.click("#editor summary")
    page.fill("#model-text", page.input_value("#model-text").replace("value: 40.0", "value: 20.0"))
    page.wait_for_selector("#model :text('k = 20 N/m')")
    page.wait_for_function(
        "before => document.getElementById('seen').innerText !== before", arg=before
    )
    page.focus("#model-text")
    page.keyboard.press("Control+End")
    page.keyboard.type("nonsense: 1")
    page.wait_for_selector("#message:has-text('nonsense')")
    assert page.evaluate("document.activeElement.id") == "model-text"
    assert page.input_value("#model-text").endswith("nonsense: 1")
    assert "k = 20 N/m" in page.inner_text("#model")


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_a_phone_from_files_to_the_records(visit, scheme, tmp_path):
    page = visit(390, scheme)
    page.wait_for_selector("text=Use it")
    assert fits(page)
    page.select_option("#system", "cart-on-spring")
    page.click("text=Use it")
    page.wait_for_selector("#record-files", state="attached")
    t = np.arange(0, 10, 0.01)
    rows = np.column_stack([t, np.sin(3 * t), 25 * np.sin(2 * t)])
    path = tmp_path / "a name that is much longer than a phone is wide, and has no end.csv"
    np.savetxt(path, rows, delimiter=",", header="zeit,kraft [N],x_cm", comments="")
    page.set_input_files("#record-files", path)
    page.wait_for_selector("#column-1")
    page.select_option("#column-1", "zeit")
    page.select_option("#column-2", "kraft [N]")
    page.fill("#unit-3", "cm")
    page.select_option("#column-3", "x_cm")
    page.wait_for_selector("#seen figure svg")
    assert page.input_value("#unit-3") == "cm"
    assert page.input_value("#column-3") == "x_cm"
    assert fits(page)
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") == (scheme == "light")


@pytest.mark.slow
def test_what_is_filled_in_while_the_server_answers_stays(visit, tmp_path):
    page = visit()
    page.wait_for_selector("text=Use it")
    page.select_option("#system", "cart-on-spring")
    page.click("text=Use it")
    page.wait_for_selector("#record-files", state="attached")
    page.set_input_files("#record-files", record_file(tmp_path, "zeit,kraft [N],x_cm"))
    page.wait_for_selector("#column-1")
    waiting = []
    page.route("**/look", lambda route: waiting.append(route))
    with page.expect_response("**/look"):
        page.select_option("#column-1", "zeit")
        page.select_option("#column-2", "kraft [N]")
        page.fill("#unit-3", "cm")
        while not waiting:
            page.wait_for_timeout(10)
        waiting[0].continue_()
    page.wait_for_selector("body:not(.busy)")  # the answer is on the page
    filled = [page.input_value(at) for at in ("#column-1", "#column-2", "#unit-3")]
    assert filled == ["zeit", "kraft [N]", "cm"]


@pytest.mark.slow
def test_a_file_that_cannot_be_used_is_an_alert(visit, tmp_path):
    page = visit()
    path = tmp_path / "model.yaml"
    path.write_text("states: {v: m/s}\nequations: {v: import}\n")
    with page.expect_response("**/model?*"):
        page.set_input_files("#model-file", path)
    page.wait_for_selector("#message:not([hidden])")
    assert "model.yaml:" in page.inner_text("[role=alert]")


@pytest.mark.slow
def test_a_model_file_brings_its_records_along(visit, tmp_path):
    page = visit()
    page.set_input_files("#model-file", [record_file(tmp_path), model_file(tmp_path)])
    page.wait_for_selector("text=run.csv")
    assert page.locator("#message").is_hidden()


@pytest.mark.slow
def test_a_file_may_be_chosen_while_the_first_answer_comes(visit):
    page, waiting = visit(), []
    page.route("**/start", lambda route: waiting.append(route))
    page.reload()
    while not waiting:
        page.wait_for_timeout(10)
    chooser = page.query_selector("#model-file")
    with page.expect_response("**/start"):
        waiting[0].continue_()
    page.wait_for_selector("body:not(.busy)")  # the answer is on the page
    assert chooser.evaluate("input => input.isConnected")


@pytest.mark.slow
def test_everything_that_is_filled_in_has_a_name(visit):
    page = visit()
    page.click("text=Show me")
    page.wait_for_selector("#seen figure svg")
    nameless = page.evaluate(
        """[...document.querySelectorAll("input, select, button")]
        .filter((e) => !(e.labels?.length || e.ariaLabel || e.textContent.trim()))
        .map((e) => e.outerHTML)"""
    )
    assert nameless == []
    ids = page.evaluate('[...document.querySelectorAll("[id]")].map((e) => e.id)')
    assert len(ids) == len(set(ids))


@pytest.mark.slow
def test_a_link_from_another_site_another_tab_and_a_reload_keep_the_session(visit, url):
    page = visit()
    page.click("text=Show me")
    page.wait_for_selector("#seen figure svg")
    for address in ("data:text/html,elsewhere", "about:blank"):
        page.goto(address)
        page.goto(url)
        assert "cart_1.csv" in page.inner_text("#records")
    page.reload()
    assert "cart_1.csv" in page.inner_text("#records")
    tab = page.context.new_page()
    tab.goto(url)
    assert "cart_1.csv" in tab.inner_text("#records")


@pytest.mark.slow
def test_a_page_of_another_server_on_this_computer_gets_nothing(browser, url):
    context, got = browser.new_context(), []
    page = context.new_page()
    page.goto(url)
    with TCPServer(("127.0.0.1", 0), recording(got)) as other:
        thread = Thread(target=other.serve_forever)
        thread.start()
        place = f"http://127.0.0.1:{other.server_address[1]}"
        page.evaluate("place => { location.href = place }", place)
        page.wait_for_url(f"{place}/")
        origin = url.rsplit("/", 2)[0]
        told = page.evaluate(
            """async origin => {
                const ask = (path, how) =>
                    fetch(origin + path, how).then(a => a.type, () => "none");
                const own = { credentials: "include", mode: "no-cors" };
                return [await ask("/sections", own), await ask("/records/1", { method: "DELETE" })];
            }""",
            origin,
        )
        other.shutdown()
        thread.join()
    assert "none" in told
    secret = url.split("/")[3]
    assert got
    assert not any(secret in str(each) or "Cookie" in each or "Referer" in each for each in got)
    page.goto(url)
    assert context.cookies() == []
    context.close()


def recording(got):
    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            got.append(dict(self.headers))
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!DOCTYPE html><link rel=icon href=data:,><p>elsewhere</p>")

        def log_message(self, *_):
            pass

    return Page


@pytest.mark.slow
def test_a_file_that_is_dropped_is_told_at_once_and_kept_until_a_model_comes(visit, tmp_path):
    page, waiting = visit(), []
    page.wait_for_selector("body:not(.busy)")
    page.route("**/records?*", lambda route: waiting.append(route))
    page.set_input_files("#model-file", record_file(tmp_path))
    page.wait_for_selector("text=Reading run.csv …")
    assert page.locator("#doing").is_visible()
    while not waiting:
        page.wait_for_timeout(10)
    waiting[0].continue_()
    page.wait_for_selector("#records .name")
    page.wait_for_selector("#doing", state="hidden")
    page.set_input_files("#record-files", model_file(tmp_path))
    page.wait_for_selector("#column-1")
    assert page.input_value("#column-3") == "v"
