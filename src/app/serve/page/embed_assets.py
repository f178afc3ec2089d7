#!/usr/bin/env python3
"""Puts the files of the page into C: embed_assets.py OUTPUT FILE..., of which the .html is the page itself."""
import os
import sys

TYPES = {'.html': 'text/html; charset=utf-8', '.css': 'text/css; charset=utf-8', '.js': 'text/javascript; charset=utf-8',
         '.wadl': 'application/vnd.sun.wadl+xml'}
output, *files = sys.argv[1:]
arrays, rows = [], []
for i, path in enumerate(files):
    name, ending = os.path.basename(path), os.path.splitext(path)[1]
    with open(path, 'rb') as f:
        data = f.read()
    lines = ',\n'.join(','.join(map(str, data[at:at + 32])) for at in range(0, len(data), 32))
    arrays.append(f'static const unsigned char asset_{i}[] = {{\n{lines}}};\n')
    rows.append(f'    {{"{"" if ending == ".html" else name}", "{TYPES[ending]}", asset_{i}, sizeof asset_{i}}},\n')
with open(output, 'w', encoding='ascii') as f:
    f.write('#include "app/serve/server.h"\n' + ''.join(arrays) + 'const CtsPageAsset cts_page_assets[] = {\n' +
            ''.join(rows) + f'}};\nconst size_t cts_page_n_assets = {len(files)};\n')
