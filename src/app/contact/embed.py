#!/usr/bin/env python3
"""Generates C arrays of the page: embed.py OUTPUT PAGE.html STYLE.css... SCRIPT.js...

Styles and scripts are inserted into the page, and their hashes into its Content-Security-Policy, so that no other
script runs, whatever the data contain. The styles are concatenated, and so are the scripts. The page is split at
the place of the data."""
import base64
import hashlib
import sys

output, page, *others = sys.argv[1:]


def text_of(path):
    with open(path, encoding='utf-8') as f:
        return f.read()


def all_of(ending):
    return '\n'.join(text_of(path) for path in others if path.endswith(ending))


def source(text):
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() + "'"


def array(name, text):
    data = text.encode()
    rows = (','.join(map(str, data[i:i + 32])) for i in range(0, len(data), 32))
    rows = ',\n'.join(rows)
    return f'const unsigned char {name}[] = {{\n{rows}}};\nconst size_t {name}_bytes = {len(data)};\n'


style, script = all_of('.css'), "'use strict';\n{\n" + all_of('.js') + '}\n'
# Pictures come from the page's own folder; on disk some browsers do not call that 'self'.
policy = ("default-src 'none'; img-src 'self' file: data:; base-uri 'none'; form-action 'none'; "
          f"style-src {source(style)}; script-src {source(script)}")
parts = text_of(page).split('@DATA@')
assert len(parts) == 2, 'the page has one place for the data'
head, tail = (part.replace('@POLICY@', policy).replace('@STYLE@', style).replace('@SCRIPT@', script) for part in parts)
with open(output, 'w', encoding='ascii') as f:
    f.write('#include "app/contact/contact_sheet.h"\n' + array('cts_contact_head', head) + array('cts_contact_tail', tail))
