"""Documents as notebooks: cells of prose and code, with outputs, pictures and without links."""

import base64
import json
from pathlib import Path
from typing import Any

import nbformat

from pyharness.edition import documents
from pyharness.edition.documents import notebook

TEXT = """# A page

See [another](../b.md#c), [a picture](x.md), and <b>.

```sh
pyharness doctor
```

```python
print(1)
```

```output
1
```

```python
draw()
```

![A curve](a.png)

The end.

![Not after an example](c.svg)
"""


def cells(text: str, **pictures: bytes) -> list[dict[str, Any]]:
    """Return the cells of a notebook, which is valid. `pictures` are those without the suffix."""
    content = notebook(text, {f"{name}.png": each for name, each in pictures.items()})
    nbformat.validate(json.loads(content))
    found: list[dict[str, Any]] = json.loads(content)["cells"]
    return found


def test_prose_and_code_are_cells_in_order() -> None:
    found = cells(TEXT, a=b"png")
    assert [cell["cell_type"] for cell in found] == ["markdown", "code", "code", "markdown"]
    assert "".join(found[0]["source"]) == (
        "# A page\n\nSee another, a picture, and <b>.\n\n```sh\npyharness doctor\n```"
    )
    assert ["".join(cell["source"]) for cell in found[1:3]] == ["print(1)", "draw()"]
    assert len({cell["id"] for cell in found}) == 4
    # Outputs and pictures follow their code.
    (stream,) = found[1]["outputs"]
    assert (stream["name"], stream["text"]) == ("stdout", ["1\n"])
    (picture,) = found[2]["outputs"]
    assert base64.b64decode(picture["data"]["image/png"]) == b"png"
    # A picture that is not there is left out.
    assert cells(TEXT)[2]["outputs"] == []


def test_a_document_without_examples_is_no_notebook(tmp_path: Path) -> None:
    for name, text in (("a.md", TEXT), ("b.md", "# B\n\n```text\nprint(1)\n```\n")):
        for folder in ("gallery", "how-to"):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / name).write_text(text)
    (tmp_path / "gallery" / "a.png").write_bytes(b"png")
    assert documents.with_notebooks(tmp_path) == [tmp_path / "gallery" / "a.md"]
    assert list(documents.notebooks(tmp_path)) == ["docs/gallery/a.ipynb"]
    found = documents.notebooks(tmp_path)["docs/gallery/a.ipynb"]
    assert found == notebook(TEXT, {"a.png": b"png"})
