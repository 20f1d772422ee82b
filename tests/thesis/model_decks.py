"""Decks of collocation programs with other numbers of terms, made from the four-term deck."""

from collections.abc import Iterator

from pyharness.thesis.cards import deck


def model_cards(terms: int) -> dict[int, str]:
    """Return the cards, by new number, of a collocation deck with `terms` terms.

    The deck is a conjecture: V.2 uses three and five terms in Case 6, but the thesis prints no such
    deck. The n collocation points are at k/(n+1) of the interval, k = 1 to n.
    """
    text = [card.text for card in deck("four-term").cards.values()]
    terms_range = range(1, terms + 1)
    end = f"T{terms + 1}"

    def made(start: str, last: str, new: list[str]) -> None:
        """Replace the cards from the text `start` to the text `last` by the statements `new`."""
        first = next(n for n, each in enumerate(text) if each.strip() == start)
        after = next(n for n in range(first, len(text)) if text[n].strip() == last)
        text[first : after + 1] = [f"      {each}" for each in new]

    def polynomials(at: str, time: str) -> Iterator[str]:
        """Yield the statements that evaluate all unknowns."""
        for column, name in enumerate(("U1", "U2", "U3", "V1", "V2", "V3"), 1):
            powers = [f"B({k},{column})*{time}" + (f"**{k}" if k > 1 else "") for k in terms_range]
            more = ["+".join(powers[3:])] if terms > 3 else []
            yield f"{name}({at})={name}(1)+" + "+".join(powers[:3]) + "+" * len(more)
            yield from more

    matrix = [
        f"A({j},{k})={k}." + (f"*T{j}" if k > 1 else "") + (f"**{k - 1}" if k > 2 else "")
        for j in terms_range
        for k in terms_range
    ]
    for old, new in (
        ("A(4,4),B(4,6),WKA(24),", f"A({terms},{terms}),B({terms},6),WKA({6 * terms}),"),
        ("T(6),F(6),G(6),H(6),", "T(8),F(8),G(8),H(8),"),
        ("X(6),Y(6),Z(6)", "X(8),Y(8),Z(8)"),
        (
            "DIMENSION U1(6),U2(6),U3(6),V1(6),V2(6),V3(6)",
            "DIMENSION U1(8),U2(8),U3(8),V1(8),V2(8),V3(8)",
        ),
    ):
        text = [each.replace(old, new) for each in text]
    name = {3: "THREE", 5: "FIVE"}.get(terms, "FOUR")
    text[text.index("C FOUR TERM APPROXIMATION")] = f"C {name} TERM APPROXIMATION, A CONJECTURE"
    made("T1=DT*.2", "T5=.01", [f"T{k}=DT*{k}./{terms + 1}." for k in terms_range] + [f"{end}=.01"])
    made("A(1,1)=1.", "A(4,4)=4.*T4**3", matrix)
    made(
        "B(1,1)=F1",
        "B(4,6)=Z1",
        [f"B({k},{c})={n}1" for c, n in enumerate("FGHXYZ", 1) for k in terms_range],
    )
    made("N=4", "IA=4", [f"N={terms}", f"IA={terms}"])
    made(
        "DO 400 L=2,5,1",
        "CB(4,6)*T(L)**4",
        [
            f"DO 400 L=2,{terms + 1},1",
            *(f"T({k + 1})=T{k}" for k in terms_range),
            *polynomials("L", "T(L)"),
        ],
    )
    second = text.index("C NOW REDO INTERVAL") + 1
    head, text = text[:second], text[second:]
    made("A(1,1)=1.", "A(4,4)=4.*T4**3", matrix)
    made(
        "B(1,1)=F(2)",
        "B(4,6)=Z(5)",
        [f"B({k},{c})={n}({k + 1})" for c, n in enumerate("FGHXYZ", 1) for k in terms_range],
    )
    made(
        "U1(6)=U1(1)+B(1,1)*T5+B(2,1)*T5**2+B(3,1)*T5**3+",
        "CB(4,6)*T5**4",
        [*polynomials(str(terms + 2), end)],
    )
    tail = next(n for n, each in enumerate(text) if each.strip().startswith("WRITE(6,5)"))
    ending = [each.replace("(6)", f"({terms + 2})") for each in text[tail:]]
    text = [*head, *text[:tail], *ending]
    # Cards that end with an operator continue on the next one.
    for n, each in enumerate(text[:-1]):
        if each.rstrip().endswith("+"):
            text[n + 1] = "     C" + text[n + 1].strip().removeprefix("C")
    return {100 + 10 * n: each for n, each in enumerate(text)}
