"""The man page's entry of an option agrees with its --help: help_man.py HELP MAN"""
import re
import sys

with open(sys.argv[1]) as f:
    helped = f.read()
with open(sys.argv[2]) as f:
    man = re.sub('f[IRB]', '', f.read().replace('\\', ''))

# Entries of the man page, each by the line that names it.
entries = []
for part in re.split(r'^\.SH', man, flags=re.M):
    for block in re.split(r'^\.TP.*\n', part, flags=re.M)[1:]:
        entries.append((block.split('\n')[0], block.replace('\n', ' ')))


def entry(option):
    return ' '.join(text for name, text in entries if re.search(option + r'([^a-z-]|$)', name))


bad = 0


def expect(good, *words):
    global bad
    if not good:
        print('FAIL:', *words)
        bad += 1


parts = re.split(r'^  (?:-., |    )(?=--)', helped, flags=re.M)[1:]
for part in parts:
    option, _, rest = ' '.join(part.split()).partition(' ')
    entry_text = entry(option)
    expect(any(re.match(r'\.BR? .*' + option + r'( |"|$)', name) for name, _ in entries), option, 'has no entry')
    # Ranges that --help prints from the library's bounds, and the names of what it lists from tables.
    found = re.search(r'\(([-0-9.e]+ to [-0-9.e+]+)', rest)
    expect(not found or found[1] in entry_text, option, '--help says', found and found[1], 'the man page does not')
    for ending in re.findall(r'(\.[a-z]{3})(?![a-z])', rest):
        expect(ending in entry_text, option, 'the man page does not know', ending)
    names = []
    if re.match(r'NAME [^o].*[:;]|NAME\[', rest.split(' (')[0]):
        names = re.split('[;:]', rest.partition(' ')[2])[0].split()
    for name in names:
        expect(re.search(r'\b' + re.escape(name) + r'\b', entry_text), option, 'the man page does not know', name)
expect(len(parts) > 100 and entry('--threads'), 'the test finds no options')
sys.exit(bad > 0)
