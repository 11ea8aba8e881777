"""Numbers as people write them with separators, and what YAML's way to write them is: 20,000 is 20000, 0,05 is 0.05."""

import re

_REST = r"(?P<power>[eE][-+]?[0-9]+)?"
_GROUPED = re.compile(
    rf"(?P<whole>[-+]?[1-9][0-9]{{0,2}}(?P<mark>[,_' ])[0-9]{{3}}(?:(?P=mark)[0-9]{{3}})*)(?P<part>\.[0-9]+)?\.?{_REST}"
)
"""digits in groups of three, as in 1,234,567.8"""
_DECIMAL = re.compile(rf"(?P<whole>[-+]?(?:[0-9]{{1,3}}(?:[. '][0-9]{{3}})+|[0-9]*)),(?P<part>[0-9]+){_REST}")
"""a comma before the decimals, as in 0,05 or 1.234,5"""
_NAMES = {",": "a comma", "_": "an underscore", "'": "an apostrophe", " ": "a space"}


def remedy(text: str) -> str:
    """What a text is that is a number with a separator, and how to write it; '' of any other text.

    >>> remedy("20,000")
    'a number with a comma: write 20000, or 20.000 where the comma is a decimal point'
    >>> remedy("0,05")
    'a number with a comma: write 0.05'
    """
    grouped, decimal = _GROUPED.fullmatch(text), _DECIMAL.fullmatch(text)
    readings = []
    if grouped is not None:
        whole = re.sub("[,_' ]", "", grouped["whole"])
        readings.append(f"{whole}{grouped['part'] or ''}{grouped['power'] or ''}")
    if decimal is not None:
        whole = re.sub("[. ']", "", decimal["whole"])
        readings.append(f"{whole if whole.strip('+-') else whole + '0'}.{decimal['part']}{decimal['power'] or ''}")
    if not readings:
        return ""
    mark = "," if grouped is None else grouped["mark"]
    other = f", or {readings[1]} where the comma is a decimal point" if len(readings) > 1 else ""
    return f"a number with {_NAMES[mark]}: write {readings[0]}{other}"
