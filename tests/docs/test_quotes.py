"""Quotes are checked line by line, and an update maps each line to the one in its place."""

import pytest

from tests.docs import typist
from tests.docs.quotes import check_quote, updated_quote


def test_a_quote_is_checked_line_by_line():
    output = "success: at rest; 6.7 s simulated in 5.9 s\nlog: a  chain: 0123456789abcdef\nlast\n"
    check_quote("success: at rest; 6.7 s simulated in 1.0 s\n last\n", output)
    check_quote("log: a ...\n", output)
    for wrong in ("success: at rest; 6.8 s simulated in 5.9 s", "last\nlog: a ...", "more"):
        with pytest.raises(AssertionError, match="the page quotes"):
            check_quote(wrong, output)


def test_lines_that_were_printed_stay_as_they_are_but_for_hashes():
    quote = "log: ...  chain: 0123456789abcdef\n\n6.7 s simulated in 1.0 s\n"
    output = "first\nlog: a.mcap  chain: {}\n6.7 s simulated in 5.9 s\nlast\n"
    assert updated_quote(quote, output.format("0123456789abcdef")) == quote
    other = quote.replace("0123456789abcdef", "fedcba9876543210")
    assert updated_quote(quote, output.format("fedcba9876543210")) == other


@pytest.mark.parametrize(
    ("line", "printed", "expected"),
    [
        ("6.2 s simulated in ... s, 63 decisions", "6.4 s simulated in 1.3 s, 65 decisions", None),
        ("identical: 51 of 51; ...; a.mcap", "identical: 52 of 52; 1.3 s; a.mcap", None),
        ("collision: 28 decisions, 1 hits, ...", "collision: 9 decisions, 0 hits, clear",
         "collision: 9 decisions, 0 hits, ..."),
        ("... at the end, 3 m", "some text at the end, 4 m", "... at the end, 4 m"),
        ("guard │ 8 │ ... │ yes", "guard │ 12 │ 3.4 │ no", "guard │ 12 │ ... │ no"),
    ],
)  # fmt: skip
def test_a_line_keeps_what_it_leaves_out(line, printed, expected):
    updated = updated_quote(f"{line}\n", f"{printed}\n")
    check_quote(updated, printed)
    assert updated.count("...") == 1
    if expected is not None:
        assert updated == f"{expected}\n"
    for number in ("63", "51", "28", "3 m", "8"):
        assert number not in updated


def test_no_printed_line_is_taken_for_two_quoted_ones():
    quote = "decision 3: action\ndecision 5: action\n"
    output = "decision 4: action\ndecision 6: another action\n"
    assert updated_quote(quote, output) == output


def test_lines_are_updated_in_their_order():
    """The more similar line is before the one that is quoted as it was printed."""
    quote = "12 of 40 decisions differ\nfirst: 3, path\nlast: 30, path\n"
    before = "head\nlast: 31, path\nfirst: 4, path\n"
    after = "14 of 41 decisions differ\nfirst: 4, path\nlast: 31, path\n"
    assert updated_quote(quote, before + after) == after


def test_more_lines_than_were_printed_are_refused():
    with pytest.raises(ValueError, match="2 lines quoted, 1 printed"):
        updated_quote("a\nb\n", "a\n")


def test_a_quote_is_updated_in_its_own_place(tmp_path):
    """Of two blocks with the same text the second alone is out of date."""
    page = tmp_path / "page.md"
    block = "```python\nprint({})\n```\n\n```text\n1\n```\n"
    page.write_text(block.format(1) + "\n" + block.format(2))
    typist.update_quotes(page)
    one, two = page.read_text().split("\n```python\nprint(2)")
    assert "```text\n1\n```" in one
    assert "```text\n2\n```" in two
