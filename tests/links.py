#!/usr/bin/env python3
"""Links of the Markdown pages lead to files and headings that exist, and named manual pages are there: links.py SOURCE_ROOT"""
import glob
import os
import re
import sys

root = sys.argv[1]
MADE = {'ctsplat-conformance.7', 'ctsplat.3'}  # by man/conformance.py and man/man3.py
pages = [p for pattern in ('*.md', 'man/*.md', 'src/*.md', 'testdata/*.md') for p in glob.glob(os.path.join(root, pattern))]


def text_of(path):
    with open(path, encoding='utf-8') as f:
        return f.read()


def anchors(path):
    """Names of headings, as GitHub makes them."""
    headings = re.findall(r'^#+ (.+)$', text_of(path), flags=re.M)
    return {re.sub(r'[^\w\- ]', '', h.lower()).replace(' ', '-') for h in headings}


bad = 0
for page in pages:
    for link in re.findall(r'\]\(([^)\s]+)\)', text_of(page)):
        name, _, heading = link.partition('#')
        target = os.path.join(os.path.dirname(page), name) if name else page
        if re.match(r'https?:', link):
            continue
        if not os.path.exists(target) or (heading and heading not in anchors(target)):
            print(f'FAIL: {os.path.relpath(page, root)}: no {link}')
            bad += 1
    for name, section in set(re.findall(r'\b(ctsplat(?:-[a-z]+)?)\((\d)\)', text_of(page))):
        file = f'{name}.{section}'
        if file not in MADE and not os.path.exists(os.path.join(root, 'man', file)):
            print(f'FAIL: {os.path.relpath(page, root)}: no manual page {file}')
            bad += 1
lines = text_of(os.path.join(root, 'README.md')).count('\n')
if lines > 150:
    print(f'FAIL: README.md has {lines} lines, more than 150')
    bad += 1
sys.exit(bad > 0 or len(pages) < 6)
