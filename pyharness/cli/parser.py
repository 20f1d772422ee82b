"""The parser of a command's options, with grouped help and errors in one line."""

import argparse
import re
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from pyharness.cli.options import FORMATS, LISTING, SCENE, check_known, warn
from pyharness.model.errors import InputError, unknown
from pyharness.model.scene_file import case_numbers

_NEGATIVE = re.compile(r"-[.\d]")
_NUMBERS = re.compile(r"-?[.\d][-+.,\deEdD]*")
_GROUPS = {**dict.fromkeys(SCENE, "scene"), **dict.fromkeys(LISTING, "version of the programs")}
_OUTPUTS = ("--format", "--plot", "--out", "--also", "--strict")
_RENAMED = {"--omega0": "--omega", "--methods": "--method", "--random": "--draws"}
_NARROWEST, _WIDEST = 80, 100  # columns


class _Formatter(argparse.HelpFormatter):
    """A help formatter that shows only required options in the usage, and keeps line breaks."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        from textwrap import wrap

        return wrap(" ".join(text.split()), width, break_on_hyphens=False)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("example:"):
            return text
        return super()._fill_text(text, width, indent)

    def _format_usage(self, *arguments: Any) -> str:
        usage, actions, *_ = arguments
        places = " ".join(f"[{each.metavar}]" for each in actions if not each.option_strings)
        forms = (usage or places).split("\n")
        lines = [" ".join([self._prog, *form.split(), "[options]"]) for form in forms]
        return "\n       ".join(["usage: " + lines[0], *lines[1:]]) + "\n\n"


class _Once(argparse.Action):
    def __call__(
        self, parser: object, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        if getattr(namespace, self.dest) is not None:
            raise InputError(f"{option} is given twice; allowed: once")
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """The parser of a command's options, whose errors suggest the nearest name."""

    def __init__(self, verb: str, description: str = "") -> None:
        self._width = _WIDEST
        self.module = import_module(f"pyharness.cli.verbs.{verb}")
        super().__init__(
            prog=f"pyharness {verb}",
            usage=getattr(self.module, "USAGE", None),
            description=f"{description[:1].upper()}{description[1:]}.",
            epilog=f"example:\n  pyharness {self.module.EXAMPLE}",
            allow_abbrev=False,
            add_help=False,
            # Specify a width, because argparse would import `shutil` to find it.
            formatter_class=lambda prog: _Formatter(prog, width=self._width),
        )
        own = {
            f"--{name}": title
            for title, names in getattr(self.module, "GROUPS", {}).items()
            for name in names.split()
        }
        titles = ["arguments", "scene", *own.values(), *_GROUPS.values(), "options", "output"]
        groups = {title: self.add_argument_group(title) for title in dict.fromkeys(titles)}
        for option, text in self.module.OPTIONS.items():
            name, _, metavar = option.partition(" ")
            if not name.startswith("--"):
                groups["arguments"].add_argument(name, nargs="?", metavar=metavar, help=text)
                continue
            usual = _GROUPS.get(option, "output" if name in _OUTPUTS else "options")
            group = groups[own.get(name, usual)]
            if metavar.startswith("["):
                group.add_argument(
                    name, action=_Once, nargs="?", const="", metavar=metavar[1:-1], help=text
                )
            elif metavar:
                group.add_argument(name, action=_Once, metavar=metavar, help=text)
            else:
                group.add_argument(name, action="store_true", help=text)
        groups["output"].add_argument("-h", "--help", action="help", help="Print this help.")

    def format_help(self) -> str:
        from shutil import get_terminal_size

        self._width = min(max(get_terminal_size().columns, _NARROWEST), _WIDEST)
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        """Raise InputError instead of printing the usage too."""
        raise InputError(message)

    def option_names(self) -> list[str]:
        return [name for name in self._option_string_actions if name.startswith("--")]

    def read(self, verb: str, arguments: Sequence[str]) -> argparse.Namespace:
        options, rest = self.parse_known_args(self._joined(arguments))
        if rest:
            raise self._left_over(verb, rest[0], arguments)
        for name, value in vars(options).items():
            # For `--name=--`, argparse returns a list.
            if isinstance(value, list):
                raise InputError(f"--{name.replace('_', '-')}: '--' is not a value; give a value")
        formats = getattr(self.module, "FORMATS", FORMATS)
        for name, fewer in getattr(self.module, "FORMATS_WITH", {}).items():
            if getattr(options, name) not in (None, False):
                formats = fewer
        check_known("format", options.format, formats)
        return options

    def _left_over(self, verb: str, word: str, arguments: Sequence[str]) -> InputError:
        """Return an InputError for a word that belongs to no option."""
        names = self.option_names()
        last, value = "", ""
        # The same word may be the value of an option before.
        places = [k for k, each in enumerate(arguments) if each == word]
        at = next((k for k in places if not self._metavar(arguments[k - 1])), places[-1])
        for each in arguments[:at]:
            if each.startswith("--"):
                last, _, value = each.partition("=")
            else:
                value = each
        if _NUMBERS.fullmatch(word) and _NUMBERS.fullmatch(value) and "," in self._metavar(last):
            return InputError(
                f"{verb} {last}: '{word}' is a second value; join numbers by commas, without "
                f"spaces, as in {last} {value},{word}"
            )
        if word.startswith("-"):
            return unknown("option", word, names, verb)
        if "--case" in names and word in map(str, case_numbers()):
            return InputError(f"{verb}: '{word}' belongs to no option; did you mean --case {word}?")
        if "--scene" in names and word.endswith(".toml"):
            return InputError(
                f"{verb}: '{word}' belongs to no option; did you mean --scene {word}?"
            )
        return InputError(
            f"{verb}: '{word}' belongs to no option; pyharness {verb} --help names them"
        )

    def _metavar(self, option: str) -> str:
        """Return what stands for the value of an option in its help; "" if it takes none."""
        action = self._option_string_actions.get(option)
        return str(getattr(action, "metavar", None) or "")

    def _joined(self, arguments: Sequence[str]) -> list[str]:
        """Return the arguments, with negative numbers joined to their options, as in --x=-1."""
        # Argparse would take negative numbers for options. Replace old option names too.
        result: list[str] = []
        for argument in arguments:
            old, equals, value = argument.partition("=")
            if old in _RENAMED and _RENAMED[old] in self.option_names():
                warn(f"{old} is now {_RENAMED[old]}")
                argument = f"{_RENAMED[old]}{equals}{value}"
            if result and result[-1] in self.option_names() and _NEGATIVE.match(argument):
                result[-1] += "=" + argument
            else:
                result.append(argument)
        return result
