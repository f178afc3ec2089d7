"""Manual pages of the library, made from its headers: man3.py VERSION SOURCE_ROOT FOLDER

A page for each header of include/ctsplat, whose comments are its text, ctsplat(3) with the example, and for each
function a page that sources its header's. meson install runs it; where DESTDIR is set, FOLDER lies below that."""
import os
import pathlib
import re
import sys


def escape(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"(?m)^([.'])", r"\\&\1", text)


def verbatim(code):
    return f".PP\n.in +4n\n.EX\n{escape(code)}\n.EE\n.in\n"


def prose(comment):
    text = re.sub(r"(?m)^ *\*? ?", "", comment.strip()[2:-2]).strip()
    return "".join(f".PP\n{escape(part)}\n" for part in re.split(r"\n\s*\n", text) if part)


def blocks(body):
    """Comments with the declarations that follow them, blocks parted by empty lines."""
    for block in re.split(r"\n\s*\n", body.strip()):
        comment = re.match(r"\s*/\*.*?\*/", block, re.S)
        code = block[comment.end():] if comment else block
        yield (prose(comment.group(0)) if comment else ""), code.strip("\n")


def functions(body):
    code = re.sub(r"/\*.*?\*/", "", body, flags=re.S)
    return re.findall(r"(?m)^(?!static|typedef)[A-Za-z][^;{}()]*?\b(cts_\w+)\(", code)


def page(name, about, version, sections):
    head = f'.TH "{name.upper()}" 3 "" "ctsplat {version}" "ctsplat library"\n.SH NAME\n{about}\n'
    return head + "".join(f".SH {title}\n{text}" for title, text in sections)


def header_page(path, version):
    source = path.read_text()
    about = re.sub(r"\s*\n \*\s*", " ", re.match(r"/\*(.*?)\*/", source, re.S).group(1)).strip()
    first, _, more = about.partition(". ")
    body = source.split("\nCTS_API_BEGIN\n")[1].split("\nCTS_API_END\n")[0] + "\n"
    names, stem = functions(body), f"ctsplat-{path.stem}"
    text = "".join(verbatim(code) + said if code else said for said, code in blocks(body))
    return names, page(stem, f"{', '.join([stem] + names)} \\- {escape(first.rstrip('.'))}", version, [
        ("SYNOPSIS", f".nf\n#include <ctsplat/{path.name}>\n.fi\n"),
        ("DESCRIPTION", (f".PP\n{escape(more)}\n" if more else "") + text),
        ("SEE ALSO", ".BR ctsplat (3),\n.BR ctsplat (1)\n")])


def main():
    version, root, folder = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3]
    folder = pathlib.Path(os.environ.get("DESTDIR", "") + folder)
    folder.mkdir(parents=True, exist_ok=True)
    listed = ""
    for path in sorted((root / "include/ctsplat").glob("*.h")):
        if path.stem in ("api", "ctsplat"):
            continue
        names, text = header_page(path, version)
        (folder / f"ctsplat-{path.stem}.3").write_text(text)
        for name in names:
            (folder / f"{name}.3").write_text(f".so man3/ctsplat-{path.stem}.3\n")
        listed += f".TP\n.BR ctsplat\\-{path.stem} (3)\n{escape(', '.join(names)) or 'Types alone.'}\n"
    (folder / "ctsplat.3").write_text(page("ctsplat", "ctsplat \\- CT series become pictures, from C", version, [
        ("SYNOPSIS", ".nf\n#include <ctsplat/ctsplat.h>\n\ncc ... $(pkg\\-config \\-\\-cflags \\-\\-libs ctsplat)\n.fi\n"),
        ("DESCRIPTION", "One call does what\n.B ctsplat render\ndoes, see\n.BR ctsplat\\-job (3);\n"
                        "the others take it apart.\n" + listed),
        ("EXAMPLE", verbatim((root / "man/example.c").read_text().rstrip())),
        ("SEE ALSO", ".BR ctsplat (1)\n")]))


main()
