"""Dialects of CSV: read as written, with a note that says how, or refused where they can be read in two ways."""

import dataclasses

import numpy as np
from tables import text_case, unusable

NAN = float("nan")
PLAIN = {"t": [0.0, 1.0], "u": [1.5, 2.0]}


def _unusable(name, text, column, *words, **expected):
    return dataclasses.replace(text_case(name, text, **expected), check=unusable(column, *words, **expected))


READ = [
    text_case("plain", "t,u\n0,1.5\n1,2\n", **PLAIN),
    text_case("semicolons and points", "t;u\n0;1.5\n1;2\n", said="semicolons between cells", **PLAIN),
    text_case("semicolons and decimal commas", "t;u\n0,0;1,5\n1,0;2\n", said="decimal commas", **PLAIN),
    text_case("decimal commas with exponents", "t;u\n0;15e-1\n1;0,2E1\n", said="decimal commas", **PLAIN),
    text_case("tabs", "t\tu\n0\t1.5\n1\t2\n", suffix=".tsv", said="tabs between cells", **PLAIN),
    text_case("tabs and decimal commas in .txt", "t\tu\n0\t1,5\n1\t2\n", suffix=".txt", said="decimal commas", **PLAIN),
    text_case("bars", "t|u\n0|1.5\n1|2\n", said="bars between cells", **PLAIN),
    text_case("line sep=;", "sep=;\nt;u\n0;1.5\n1;2\n", said="semicolons between cells", first_row=3, **PLAIN),
    text_case("quoted line sep=;", '"sep=;"\nt;u\n0;1.5\n1;2\n', said="semicolons", **PLAIN),
    text_case("unit in parentheses", "t (ms),u\n0,1.5\n1000,2\n", said="units in parentheses", **PLAIN),
    text_case("unit in parentheses without a blank", "t(s),u(km/h)\n0,5.4\n1,7.2\n", said="parentheses", **PLAIN),
    text_case("parentheses that hold no unit", "t,u (port)\n0,1.5\n1,2\n", **{"t": [0, 1], "u (port)": [1.5, 2.0]}),
    text_case("row of units", "t,u\nms,km/h\n0,5.4\n1000,7.2\n", said="units from row 2", first_row=3, **PLAIN),
    text_case("row of units in brackets", "t,u\n[ms],[km/h]\n0,5.4\n1000,7.2\n", said="units from row 2", **PLAIN),
    text_case("row of units with a dash", "t,u\ns,-\n0,1.5\n1,2\n", said="units from row 2", **PLAIN),
    text_case("row of units with a blank", "t,u\n(s),\n0,1.5\n1,2\n", said="units from row 2", **PLAIN),
    text_case("row of the units that headers state", "t[s],u[m/s]\ns,m/s\n0,1.5\n1,2\n", said="from row 2", **PLAIN),
    text_case("comments above", '# "3\n% x\n// y\nt,u\n0,1.5\n1,2\n', said="comments above", first_row=5, **PLAIN),
    text_case("comments below the headers", "t,u\n# calm\n0,1.5\n1,2\n", first_row=3, **PLAIN),
    text_case("comment at the end", "t,u\n0,1.5\n1,2\n# end, of log\n", **PLAIN),
    text_case("blank lines above", "\n\nt,u\n0,1.5\n1,2\n", first_row=4, **PLAIN),
    text_case("headers in a comment", "# a\n# t,u\n0,1.5\n1,2\n", said="headers from the comment", **PLAIN),
    text_case("index column", ",t,u\n0,0,1.5\n1,1,2\n", said="column 1 left out, which has no header", **PLAIN),
    text_case("quoted nameless column", '"","t","u"\n"a",0,1.5\n"b",1,2\n', said="column 1 left out", **PLAIN),
    text_case("separator after headers and cells", "t,u,\n0,1.5,\n1,2,\n", said="column 3 left out", **PLAIN),
    text_case("separator after cells", "t,u\n0,1.5,\n1,2,\n", said="a separator at the end of each row", **PLAIN),
    text_case("blank last lines", "t,u\n0,1.5\n1,2\n\n  \n,\n\n", **PLAIN),
    text_case("lines that end with CR", "t,u\r0,1.5\r1,2\r", **PLAIN),
    text_case("lines that end with CR LF", "t,u\r\n0,1.5\r\n1,2\r\n\r\n", **PLAIN),
    text_case("quoted numbers", '"t","u"\n"0","1.5"\n"1","2"\n', **PLAIN),
    text_case("quoted decimal commas", '"t","u"\n"0","1,5"\n"1","2"\n', said="decimal commas", **PLAIN),
    text_case("blanks around cells", "t , u\n 0 , 1.5\n 1 , 2\n", **PLAIN),
    text_case("plus signs and bare points", "t,u\n+0,+1.5e0\n1.,.2e1\n", **PLAIN),
    text_case("UTF-8 with a mark", "\ufefft,u\n0,1.5\n1,2\n", **PLAIN),
    text_case("UTF-16", "t,u\n0,1.5\n1,2\n", encoding="utf-16", said="text in utf-16", **PLAIN),
    text_case("UTF-16 big-endian", "\ufefft,u\n0,1.5\n1,2\n", encoding="utf-16-be", said="text in utf-16", **PLAIN),
    text_case("cp1252", "t;psi[°]\n0;0\n1;180\n", encoding="cp1252", said="text in cp1252", t=[0, 1], psi=[0, np.pi]),
    text_case("UTF-8 name", "t,größe\n0,1\n1,2\n", t=[0, 1], größe=[1, 2]),
    text_case("ISO 8601", "t,u\n2024-06-01T12:00:59.5,1.5\n2024-06-01T12:01:00.5,2\n", said="ISO 8601", **PLAIN),
    text_case("ISO 8601 in UTC", "t,u\n2024-06-01 23:59:59Z,1.5\n2024-06-02 00:00:00Z,2\n", said="ISO 8601", **PLAIN),
    text_case(
        "ISO 8601 in two zones",
        "t,u\n2024-06-01T12:00:00+02:00,1.5\n2024-06-01T10:00:01Z,2\n",
        said="ISO 8601",
        **PLAIN,
    ),
    text_case(
        "ISO 8601 in nanoseconds",
        "t,u\n2024-06-01T12:00:00.000000001Z,1.5\n2024-06-01T12:00:00.000000003Z,2\n",
        said="ISO 8601",
        t=[0.0, 2e-9],
        u=[1.5, 2.0],
    ),
    text_case("spellings of missing", "t,u\n0,NA\n1,2\n", said="'NA' is read as missing", t=[0, 1], u=[NAN, 2]),
    text_case("null", "t,u\n0,null\n1,2\n", said="'null' is read as missing", t=[0, 1], u=[NAN, 2]),
    text_case("dash for missing", "t,u\n0,-\n1,2\n", said="'-' is read as missing", t=[0, 1], u=[NAN, 2]),
    text_case("NaN and blank need no note", "t,u,v\n0,NaN,\n1,nan,2\n", t=[0, 1], u=[NAN, NAN], v=[NAN, 2]),
    text_case("thousands with decimals", 't,u\n0,"1,234.5"\n1,2\n', said="thousands are set", t=[0, 1], u=[1234.5, 2]),
    text_case("thousands twice", 't,u\n0,"-1,234,567"\n1,2\n', said="thousands", t=[0, 1], u=[-1234567, 2]),
    text_case("thousands by apostrophes", "t,u\n0,1'234.5\n1,2\n", said="thousands", t=[0, 1], u=[1234.5, 2]),
    text_case("thousands by points", "t;u\n0,5;1.234,5\n1;2\n", said="thousands", t=[0.5, 1], u=[1234.5, 2]),
    text_case("a name with a semicolon", "t,a;b\n0,1\n1,2\n", **{"t": [0, 1], "a;b": [1, 2]}),
    text_case("nearest double", "t,u\n0,0.1\n1,9007199254740993\n", t=[0, 1], u=[0.1, 9007199254740992.0]),
    text_case("subnormal", "t,u\n0,5e-324\n1,2.2250738585072011e-308\n", t=[0, 1], u=[5e-324, 2.225073858507201e-308]),
]
UNUSABLE = [
    _unusable("text that nobody needs", "t,u,note\n0,1.5,go\n1,2,\n", "note", "column 'note': 'go' is not", **PLAIN),
    _unusable("a thousand or a fraction", 't,u,n\n0,1.5,"1,234"\n1,2,5\n', "n", "may be a thousand", **PLAIN),
    _unusable("point or thousands under semicolons", "t;n\n0;1.234\n1;2.345\n", "n", "may be a thousand", t=[0, 1]),
    _unusable("comma or thousands under semicolons", "t;n\n0;1,234\n1;2,345\n", "n", "may be a thousand", t=[0, 1]),
    _unusable("commas and points", "t;u;n\n0.5;1,5;1.5\n1;2;2\n", "u", "has a decimal comma", t=[0.5, 1], n=[1.5, 2]),
    _unusable("digits with underscores", "t,u,n\n0,1.5,1_000\n1,2,3\n", "n", "'1_000' is not a number", **PLAIN),
    _unusable("other digits", "t,u,n\n0,1.5,٣\n1,2,3\n", "n", "is not a number", **PLAIN),
    _unusable("hexadecimal", "t,u,n\n0,1.5,0x1A\n1,2,3\n", "n", "'0x1A' is not a number", **PLAIN),
    _unusable("two units", "t,u,r[rad/s]\ns,,deg/s\n0,1.5,3\n1,2,4\n", "r", "rad/s and deg/s", **PLAIN),
    _unusable("a late bad cell", "t,u,n\n" + "0,1.5,1\n1,2,x\n", "n", "row 3, column 'n': 'x'", **PLAIN),
    _unusable("a name twice", "t,u,n,n\n0,1.5,1,1\n1,2,2,2\n", "n", "name one column", **PLAIN),
]
REFUSED = [
    text_case(
        "decimal commas between commas", "t,u\n0,0,1,5\n1,0,2,5\n", "row 2: 4 cells under 2 headers", "semicolons"
    ),
    text_case("commas in headers, semicolons in rows", "t,u\n0,5;1,5\n1,5;2,5\n", "row 2: 3 cells under 2 headers"),
    text_case("two separators", "t,a;b\n0,1;2\n1,2;3\n", "separated by commas or semicolons", "sep=;"),
    text_case("separated by blanks", "t u\n0 1.5\n1 2\n", "separated by blanks", "commas", suffix=".txt"),
    text_case("commas and points in the time", "t;u\n0,5;1\n1.5;2\n", "column 't'", "decimal"),
    text_case("time of the day", "t,u\n12:00:00,1\n12:00:01,2\n", "row 2, column 't': '12:00:00' is not a number"),
    text_case("instants with and without a zone", "t,u\n2024-06-01T12:00:00Z,1\n2024-06-01T12:00:01,2\n", "no instant"),
    text_case(
        "no such date", "t,u\n2024-06-01T12:00:00,1\n2024-06-31T12:00:01,2\n", "row 3", "no instant like the first"
    ),
    text_case("instants out of order", "t,u\n2024-06-01T12:00:01,1\n2024-06-01T12:00:00,2\n", "does not come after"),
    text_case("comment between samples", "t,u\n0,1\n# x\n1,2\n", "row 3: a comment between samples", "delete it"),
    text_case("blank line between samples", "t,u\n0,1\n\n1,2\n", "row 3: 0 cells under 2 headers"),
    text_case("blank row between samples", "t,u\n0,1\n,\n1,2\n", "row 3: a blank row between samples"),
    text_case("row numbers below comments", "# a\n# b\nt,u\n0,1\n1,2\n1,3\n", "row 6: time 1.0 s does not come after"),
    text_case("row number below a row of units", "t,u\ns,m\n0,1\nx,2\n", "row 4, column 't[s]': 'x' is not a number"),
    text_case("another name of the time", "time (s),u\n0,1\n1,2\n", "no time column 't'", "rename 'time' to 't'"),
    text_case("no headers", "0,1\n1,2\n2,3\n", "has no time column 't'"),
    text_case("UTF-32", "t,u\n0,1\n1,2\n", "UTF-32", "save it as UTF-8", encoding="utf-32"),
    text_case("UTF-16 without a mark", "t,u\n0,1\n1,2\n", "holds control characters", encoding="utf-16-le"),
    text_case("an image", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "holds control characters"),
    text_case("not even cp1252", b"t,u\n0,1\n1,2\x81\xff\n", "no text in UTF-8, UTF-16 or cp1252"),
    text_case("only comments", "# a\n# b\n", "is empty"),
    text_case("a cell without end", 't,u\n0,"1\n' + "1,2\n" * 50_000, "cannot be read", "field larger"),
    text_case("only a separator line", "sep=;\n", "is empty"),
]
CASES = [*READ, *UNUSABLE, *REFUSED]
