"""Small `.lvm` files, one a dialect, by name: the tests read them, the fuzzing mutates them."""

from collections.abc import Sequence

END = "***End_of_Header***"


def file_header(separator: str = "\t", **tags: str) -> str:
    """Return a file header; a tag given as an empty text keeps its line without a value, as None it has no line."""
    given = {
        "Writer_Version": "2",
        "Reader_Version": "2",
        "Separator": {"\t": "Tab", ",": "Comma"}.get(separator, ""),
        "Decimal_Separator": ".",
        "Multi_Headings": "No",
        "X_Columns": "One",
        "Time_Pref": "Relative",
        "Operator": "rig",
        "Date": "2019/03/01",
        "Time": "06:04:45.0332875251770019531",
        **tags,
    }
    lines = [f"{tag}{separator if value else ''}{value}" for tag, value in given.items()]
    return "\n".join([f"LabVIEW Measurement{separator}", *lines, f"{END}{separator}", separator]) + "\n"


def segment_header(lines: dict[str, Sequence[str]], separator: str = "\t") -> str:
    rows = [separator.join([tag, *cells, ""]) for tag, cells in lines.items()]
    return "\n".join([*rows, END + separator]) + "\n"


def segment(
    names: Sequence[str],
    rows: str,
    samples: Sequence[str],
    separator: str = "\t",
    x0: Sequence[str] = (),
    delta: Sequence[str] = (),
    units: Sequence[str] = (),
    notes: str = "",
) -> str:
    """Return a segment: its header, names between `X_Value` and `Comment`, and rows written with tabs."""
    number = len(names)
    lines: dict[str, Sequence[str]] = {"Notes": [notes]} if notes else {}
    lines |= {
        "Channels": [str(number)],
        "Samples": samples,
        "Y_Unit_Label": units or ["Volts"] * number,
        "X_Dimension": ["Time"] * number,
        "X0": x0 or ["0.0000000000000000E+0"] * number,
        "Delta_X": delta or ["0.100000"] * number,
    }
    body = separator.join(["X_Value", *names, "Comment"]) + "\n" + rows.replace("\t", separator)
    return segment_header(lines, separator) + body


ROWS = "0.000000\t1.000000\t-2.500000\n0.100000\t1.125000\t-2.250000\n0.200000\t1.250000\t-2.000000\n"
TWO = ("acc", "load")
DATA = segment(TWO, ROWS, ["3", "3"])
NO_X_ROWS = "\t1.000000\t-2.500000\n\t1.125000\t-2.250000\n\t1.250000\t-2.000000\n"
MULTI = (
    segment_header(
        {
            "Channels": ["2"],
            "Samples": ["3", "", "2", ""],
            "Y_Unit_Label": ["g", "", "kN", ""],
            "X0": ["0.0", "", "-1.0", ""],
            "Delta_X": ["0.1", "", "0.5", ""],
        }
    )
    + "X_Value\tacc\tX_Value\tload\tComment\n"
    + "0.000000\t1.000000\t-1.000000\t-2.500000\n0.100000\t1.125000\t-0.500000\t-2.250000\n0.200000\t1.250000\t\t\n"
)
LATER = DATA.replace("1.000000", "9.000000")
#: The table above, in every way that it may be written.
SAME = {
    "tab": file_header() + DATA,
    "comma": file_header(",") + segment(TWO, ROWS, ["3", "3"], ","),
    "separator without a value": file_header(Separator="") + DATA,
    "comma without a value": file_header(",", Separator="") + segment(TWO, ROWS, ["3", "3"], ","),
    "decimal comma": file_header(Decimal_Separator=",")
    + segment(TWO, ROWS.replace(".", ","), ["3", "3"], x0=["0,0000000000000000E+0"] * 2, delta=["0,100000"] * 2),
    "decimal comma unsaid": (
        file_header() + segment(TWO, ROWS.replace(".", ","), ["3", "3"], delta=["0,1"] * 2)
    ).replace("Decimal_Separator\t.\n", ""),
    "no X": file_header(X_Columns="No") + segment(TWO, NO_X_ROWS, ["3", "3"]),
    "no X and no column for it": file_header(X_Columns="No")
    + segment(TWO, NO_X_ROWS.replace("\n\t", "\n")[1:], ["3", "3"]).replace("X_Value\t", ""),
    "blank first label": file_header() + DATA.replace("X_Value\t", "\t"),
    "first label left out": file_header() + DATA.replace("X_Value\t", ""),
    "no X and a blank first label": (file_header(X_Columns="No") + segment(TWO, NO_X_ROWS, ["3", "3"])).replace(
        "X_Value\t", "\t"
    ),
    "notes": file_header()
    + segment(TWO, ROWS, ["3", "3"], notes="rig warm\nleft door open, 3 times\n\nSpeed 15 km/h, load 20 kN"),
    "special block": file_header()
    + "***Start_Special***\nBinary_Data\n1\t2\t3\n***End_Special***\n"
    + DATA.replace(END + "\t\n", END + "\t\n***Start_Special***\nPacket_Notes\tx\n***End_Special***\n")
    + "***Start_Special***\nWfm_Sclr_Meas\n7\t8\t9\n***End_Special***\n",
    "comments": file_header()
    + DATA.replace("-2.500000\n", "-2.500000\t06:04:45 started\n").replace("-2.000000\n", "-2.000000\tstop_1 \xb5\n"),
    "comment in the first row": file_header() + DATA.replace("-2.500000\n", "-2.500000\t06:04:45\n"),
    "comments with commas": file_header(",")
    + segment(TWO, ROWS, ["3", "3"], ",").replace("-2.250000\n", "-2.250000,it, then, stopped\n"),
    "trailing tabs": file_header() + DATA.replace("000\n", "000\t\t\n"),
    "blank lines": file_header() + DATA.replace("-2.500000\n", "-2.500000\n\n  \n") + "\n\t\t\n\n",
    "padded cells": file_header() + DATA.replace("\t-2", "\t  -2").replace("1.125000", "+1.125000 "),
    "CRLF": (file_header() + DATA).replace("\n", "\r\n"),
    "CR": (file_header() + DATA).replace("\n", "\r"),
    "no asterisks": (file_header() + DATA).replace("***", "").replace("LabVIEW Measurement\t\n", ""),
    "no blank line": (file_header() + DATA).replace("\n\t\n", "\n"),
    "no end of the last line": (file_header() + DATA).rstrip("\n"),
}
OTHERS = {
    "multi": file_header(X_Columns="Multi", Multi_Headings="Yes") + MULTI,
    "segments": file_header(Multi_Headings="Yes") + DATA + "\n" + LATER,
    "segments without a blank line": file_header(Multi_Headings="Yes") + DATA + LATER,
    "two files": file_header() + DATA + "\n" + file_header(X_Columns="No") + segment(TWO, NO_X_ROWS, ["3", "3"]),
    "two writes": file_header()
    + DATA
    + ROWS.replace("0.2", "0.5").replace("0.1", "0.4").replace("0.000000", "0.300000"),
    "X that resets": file_header() + DATA + ROWS,
    "fewer rows": file_header() + segment(TWO, ROWS, ["150000", "150000"]),
    "latin-1": (file_header() + segment(("Temp\xe9rature", "load"), ROWS, ["3", "3"], units=["\xb0C", "kN"])),
    "unequal": file_header() + segment(TWO, ROWS.replace("-2.250000", "").replace("-2.000000", ""), ["3", "1"]),
    "unequal, cut short": file_header() + DATA.replace("\t-2.250000", "").replace("\t-2.000000", ""),
    "two rates": file_header()
    + segment(
        TWO,
        "0.0\t1.0\t5.0\n0.1\t1.1\t6.0\n0.2\t1.2\t\n0.3\t1.3\t\n",
        ["4", "2"],
        delta=["0.1", "0.2"],
        notes="X values guaranteed valid only for acc",
    ),
    "two rates, two writes": file_header()
    + segment(
        TWO, "0.0\t1.0\t5.0\n0.1\t1.1\t\n0.2\t1.2\t6.0\n0.3\t1.3\t\n0.4\t1.4\t7.0\n", ["2", "1"], delta=["0.1", "1.0"]
    ),
    "rounded X": file_header()
    + segment(TWO, "0.00\t1.0\t5.0\n0.04\t1.1\t6.0\n0.08\t1.2\t7.0\n", ["3", "3"], delta=["3.906250E-2"] * 2),
    "empty channel": file_header() + segment(TWO, "0.0\t1.0\t\n0.1\t1.1\t\n", ["2", "0"]),
    "empty cells": file_header() + DATA.replace("1.125000", ""),
    "NaN": file_header() + DATA.replace("1.125000", "NaN").replace("-2.250000", "1.#QNAN").replace("-2.000000", "  "),
    "negative X0": file_header(X_Columns="No") + segment(TWO, NO_X_ROWS, ["3", "3"], x0=["-0.5", "-0.25"]),
    "truncated": (file_header() + DATA)[:-4],
    "truncated within the row": (file_header() + DATA)[:-14],
    "truncated header": file_header() + DATA + "\nChannels\t2\nSamp",
    "plain tab": ROWS,
    "plain comma": ROWS.replace("\t", ","),
    "plain space": ROWS.replace("\t", "  "),
    "plain semicolon": ROWS.replace("\t", ";").replace(".", ","),
    "plain space, decimal comma": ROWS.replace("\t", " ").replace(".", ","),
    "plain with names": "time\tacc\tload\n" + ROWS,
    "plain without X": NO_X_ROWS,
    "plain one column": "1.5\n1.25\n3.5\n",
}
FILES = {name: text.encode("latin-1" if name == "latin-1" else "utf-8") for name, text in (SAME | OTHERS).items()} | {
    "utf-8 with a mark": b"\xef\xbb\xbf" + SAME["tab"].replace("Volts\tVolts", "m/s\xb2\t\xb5V").encode()
}
#: Files without a row.
BAD = {
    "a header and no data": file_header() + segment(TWO, "", ["3", "3"]),
    "a header alone": file_header(),
    "a header and lines of tabs": file_header() + "C\n\n\t\t\n\n",
    "a cut header": file_header()[:60],
    "empty": "",
}
