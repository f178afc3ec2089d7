#!/usr/bin/env python3
"""The contact sheet in a headless Chromium: contact_page.py CTSPLAT TESTDATA [PICTURES]

One series is rendered by `ctsplat batch`; its journal record is repeated 3,000 times, one in twenty of them
failed, with names and reasons that look like markup. With PICTURES, screenshots are saved in that folder."""
import json
import os
import random
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import webdriver  # noqa: E402

N = 3000
EVIL = '</script><img src=x onerror="window.evil=1"><script>window.evil=1</script>\u202e'
REASONS = [('refused', 'its slices name different patients'), ('failed', 'killed by signal 9'), ('refused', EVIL)]
FINDINGS = [('gap', 'warning', 'one slice is missing & was <b>interpolated</b>'), ('tilt', 'note', 'gantry tilt kept')]


def check(condition, *what):
    if not condition:
        print('FAIL:', *what)
        sys.exit(1)


def make_batch(ctsplat, testdata, folder):
    """A batch of one real series, whose record is then repeated; returns the records."""
    subprocess.run([ctsplat, 'batch', os.path.join(testdata, 'phantom'), '-O', folder, '--presets', 'bone,skin',
                    '--views', 'anterior,head', '--size', '256x256', '--rotation', '6'], check=True,
                   stderr=subprocess.DEVNULL)
    journal = os.path.join(folder, 'batch.jsonl')
    with open(journal, encoding='utf-8') as f:
        line = json.loads(f.readline())
    check(line['status'] == 'done' and line['thumbnails'], 'batch did not render the phantom')
    r = random.Random(12)
    lines = []
    for i in range(N):
        series = json.loads(json.dumps(line))
        series['series_uid'] = f'1.2.826.0.1.3680043.{r.randrange(10**9)}.{i}'
        series['ended'] = f'2026-11-22T{i // 3600:02}:{i // 60 % 60:02}:{i % 60:02}Z'
        series['geometry']['slices'] = r.randrange(20, 900)
        series['labels'] = [{'name': 'liver', 'ml': r.randrange(900, 1700), 'parts': 1, 'hu_mean': 90.5},
                            {'name': 'spleen' if i % 2 else EVIL, 'ml': 10, 'label_in_air': i % 100 == 7}]
        if i == 321:
            series['labels'][0]['ml'] = 6000
        series['findings'] = [dict(zip(('code', 'severity', 'text'), f)) for f in FINDINGS if r.random() < .2]
        if i % 20 == 19:
            series['status'], series['reason'] = REASONS[i // 20 % len(REASONS)]
            series['outputs'] = series['thumbnails'] = []
        lines.append(series)
    lines[-1]['series_uid'] = EVIL
    # Nothing has the type that it should have.
    lines[-2].update(series_uid='odd', status='done', reason={}, findings=[None, 3, {'text': []}], geometry=[1],
                     stages=[None], outputs=[None, 1, {'path': 5}, {'path': 'x.png', 'preset': {}}],
                     thumbnails={}, wall_ms='long', labels=[None, {'ml': 'x', 'name': {}}])
    with open(journal, 'w', encoding='utf-8') as f:
        f.writelines(json.dumps(s) + '\n' for s in lines)
    subprocess.run([ctsplat, 'batch', '--merge', folder], check=True)
    return lines


def until(browser, script, what, *arguments):
    for _ in range(600):
        if browser.run(f'return {script}', *arguments):
            return
        time.sleep(.1)
    check(False, 'timed out waiting for:', what, browser.run('return document.activeElement.outerHTML')[:200])


def shown(browser):
    until(browser, 'document.getElementById("sheet").ariaBusy === "false"', 'all cards are there')
    return browser.run('return document.querySelectorAll("#sheet article").length')


def choose(browser, name, value):
    browser.run('const s = document.getElementById(arguments[0]); s.value = arguments[1];'
                's.dispatchEvent(new Event("input"))', name, value)


def check_opens(browser, page):
    browser.open(page)
    until(browser, 'document.documentElement.dataset.ready', 'the page is ready')
    check(shown(browser) == N, shown(browser), 'cards')
    until(browser, '[...document.querySelectorAll("#sheet img")].filter(i => i.naturalWidth === 240).length > 3',
          'thumbnails come')
    asked = browser.requests()
    away = [url for url in asked if not url.startswith(('file:', 'data:', 'chrome:'))]
    check(not away, 'the page asks the network for', away[:3])
    thumbnails = sum(url.endswith('.webp') for url in asked)
    check(thumbnails < 400, thumbnails, 'thumbnails are loaded before they come into sight')
    check(not browser.messages(), 'the browser complains')


def check_search(browser, lines):
    uid = lines[1234]['series_uid']
    browser.type('#search', uid[-9:])
    check(shown(browser) == 1, shown(browser), 'series have this UID')
    check(browser.run('return document.querySelector("#sheet h2").title') == uid, 'another series was found')
    check('1 of 3,000' in browser.run('return document.getElementById("count").textContent'), 'the number of visible series is missing')
    browser.run('document.getElementById("search").value = ""')
    browser.type('#search', 'SIGNAL killed')
    check(shown(browser) == sum('signal' in str(s['reason']) for s in lines), 'the search for a reason finds others')
    browser.run('document.getElementById("search").value = ""')
    browser.type('#search', 'nothing has this')
    empty = not browser.run('return document.getElementById("empty").hidden')
    check(shown(browser) == 0 and empty, 'no message without a match')
    browser.click('#clear')
    check(shown(browser) == N, 'all series do not come back')


def check_filter_and_sort(browser, lines):
    for status in ('done', 'refused', 'failed', 'all'):
        browser.click(f'#status [value={status}]')
        check(shown(browser) == sum(status in ('all', s['status']) for s in lines), status, shown(browser))
    choose(browser, 'finding', 'gap')
    check(shown(browser) == sum('gap' in str(s['findings']) for s in lines), 'finding gap')
    choose(browser, 'preset', 'skin')
    check(shown(browser) == sum('gap' in str(s['findings']) and bool(s['thumbnails']) for s in lines),
          'finding gap with preset skin')
    choose(browser, 'finding', '')
    choose(browser, 'preset', '')
    order = ('return [...document.querySelectorAll("#sheet article")].slice(0, 50)'
             '.map(a => a.querySelector("h2").title)')
    by_uid = {s['series_uid']: 0 if s['series_uid'] == 'odd' else s['geometry']['slices'] for s in lines}
    for reverse in (True, False):
        choose(browser, 'sort', 'slices')
        found = [by_uid.get(uid) for uid in browser.run(order)]
        check(None not in found and found == sorted(found, reverse=reverse), 'sorted by slices:', found)
        browser.click('#direction')
    choose(browser, 'sort', 'ended')


def check_labels(browser, lines):
    browser.type('#search', 'liver')
    choose(browser, 'sort', 'volume')
    check(shown(browser) == N - 1, shown(browser), 'series have a liver')
    first = browser.run('return document.querySelector("#sheet article").textContent')
    check(lines[321]['series_uid'] in first and 'liver, 6000 ml · 1 flagged' in first and '× the median' in first, first)
    browser.run('document.getElementById("search").value = ""')
    browser.type('#search', 'lies in air')
    check(shown(browser) == sum(len(s['labels']) > 1 and s['labels'][1].get('label_in_air') is True for s in lines),
          'labels in air')
    browser.run('document.getElementById("search").value = ""')
    browser.type('#search', ' ')
    choose(browser, 'sort', 'ended')


def check_viewer(browser):
    picture = 'document.querySelector(".picture img")'
    browser.click('#status [value=done]')
    browser.click('#sheet article:nth-child(2) [data-picture="1"]')
    until(browser, f'document.getElementById("viewer").open && {picture}.naturalWidth === 256',
          'the full picture opens')
    check(browser.run(f'return {picture}.src').endswith('/bone-head-000.png'), browser.run(f'return {picture}.src'))
    for key, ending in (('.', 'bone-head-001'), (',', 'bone-head-000'), (',', 'bone-head-005'),
                        ('Right', 'skin-anterior-000'), ('Left', 'bone-head-000'), ('z', 'bone-head-000')):
        browser.press(key)
        until(browser, f'{picture}.src.endsWith(arguments[0])', f'{key} shows {ending}', f'/{ending}.png')
    check(browser.run('return document.querySelector(".picture").classList.contains("exact")'), 'z does not zoom')
    title = browser.run('return document.getElementById("viewer-title").textContent')
    browser.press('Down')
    check(browser.run('return document.getElementById("viewer-title").textContent') != title, 'the next series')
    browser.click('#play')
    until(browser, f'!{picture}.src.endsWith("-000.png")', 'the rotation plays')
    browser.press('Escape')
    check(not browser.run('return document.getElementById("viewer").open'), 'Esc does not close')
    until(browser, 'document.activeElement.ariaPosInSet === "3"', 'the card last seen has the focus')


def check_keys(browser):
    browser.press('Right')
    check(browser.run('return document.activeElement.ariaPosInSet') == '4', 'arrows do not go from card to card')
    browser.press('Space')
    until(browser, 'document.activeElement.querySelectorAll(".strip img").length === 4', 'Space plays all rotations')
    browser.press('Space')
    check(not browser.run('return document.querySelector(".strip")'), 'Space does not stop them')
    browser.press('Enter')
    check(browser.run('return document.getElementById("viewer").open'), 'Enter does not open')
    browser.press('Escape', '/')
    check(browser.run('return document.activeElement.id') == 'search', '/ does not search')
    browser.hover('#sheet article:nth-child(3) [data-picture="0"]')
    until(browser, 'document.querySelector(".strip img")?.naturalWidth === 6 * 240', 'a rotation plays under the mouse')
    browser.press('End')
    browser.run('document.querySelector("#sheet article").focus()')
    browser.press('End')
    until(browser, 'document.querySelector("#sheet article:last-child .facts")', 'the last card is filled')


def check_hostile(browser):
    browser.click('#status [value=all]')
    browser.type('#search', 'onerror')
    check(shown(browser) > 10, 'hostile series are not found')
    check(not browser.run('return window.evil'), 'a script from the journal has run')
    check(not browser.run('return document.querySelector("#sheet script, #sheet [onerror]")'), 'text became markup')
    text = browser.run('return document.getElementById("sheet").textContent')
    check('<img src=x' in text and '\u202e' not in text, 'what is shown is not what was written')
    browser.press('Escape')


def check_under_way(browser, ctsplat, testdata, folder):
    """The sheet of a batch that is still running: right at any moment, and loaded again by itself."""
    run = subprocess.Popen([ctsplat, 'batch', os.path.join(testdata, 'phantom'), os.path.join(testdata, 'geometry'), '-O',
                            folder, '--presets', 'bone,skin,muscle', '--views', 'anterior,left', '--size', '640x640',
                            '--jobs', '1', '--threads', '1'], stderr=subprocess.DEVNULL)
    page = os.path.join(folder, 'index.html')
    while not os.path.exists(page) and run.poll() is None:
        time.sleep(.05)
    browser.open('file://' + page)
    until(browser, 'document.documentElement.dataset.ready', 'the page of a batch under way')
    summary = browser.run('return document.getElementById("summary").textContent')
    check('under way: ' in summary and ' of ' in summary, 'the page does not show that the batch is running:', summary)
    before = shown(browser)
    run.wait()
    for _ in range(200):
        try:
            if 'under way' not in browser.run('return document.getElementById("summary").textContent'):
                break
        except RuntimeError:
            pass  # it is being loaded
        time.sleep(.1)
    with open(os.path.join(folder, 'batch.jsonl'), encoding='utf-8') as f:
        lines = [json.loads(line) for line in f]
    check(shown(browser) == len(lines) > before, shown(browser), 'cards of', len(lines), 'series, before', before)
    n_passed = sum(line['status'] == 'thumbnail' for line in lines)
    check(n_passed > 0, 'no thumbnail')
    browser.click('#status [value=thumbnail]')
    check(shown(browser) == n_passed, shown(browser), 'thumbnails, not', n_passed)
    check(not browser.messages(), 'the browser complains of a page under way')


def check_names(browser):
    """Every control and image has an accessible name."""
    nodes = browser.devtools('Accessibility.getFullAXTree', {})['nodes']
    roles = {'button', 'link', 'combobox', 'slider', 'searchbox', 'article', 'image', 'feed', 'listbox'}
    for node in nodes:
        role = node.get('role', {}).get('value')
        if role in roles and not node.get('ignored'):
            check(node.get('name', {}).get('value', '').strip(), 'without a name:', role, node.get('properties'))


def check_width(browser, what):
    wide = browser.run('return document.scrollingElement.scrollWidth - innerWidth')
    check(wide <= 0, what, 'scrolls sideways by', wide)


def check_runs(ctsplat, testdata):
    """The page of one series, without interaction: its script ends without an error, and there is a card."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        subprocess.run([ctsplat, 'batch', os.path.join(testdata, 'phantom'), '-O', folder, '--size', '64x64'],
                       check=True, stderr=subprocess.DEVNULL)
        page = subprocess.run(['chromium', '--headless', '--no-sandbox', '--disable-gpu', '--dump-dom',
                               '--disable-dev-shm-usage', '--disable-background-networking',
                               '--host-resolver-rules=MAP * ~NOTFOUND', f'--user-data-dir={folder}/profile',
                               f'file://{folder}/index.html'], capture_output=True, text=True, timeout=200).stdout
        check('data-ready="true"' in page and '<article class="card done' in page, 'the page does not run')


def main():
    ctsplat, testdata = map(os.path.abspath, sys.argv[1:3])
    pictures = sys.argv[3] if len(sys.argv) > 3 else None
    if webdriver.missing():
        print('skip: no', webdriver.missing(), '(packages chromium and chromium-driver)')
        sys.exit(77)
    if subprocess.run([ctsplat, 'batch', '--help'], capture_output=True).returncode:
        print('skip: no batch in this build')
        sys.exit(77)
    if not os.environ.get('CTS_SOAK'):  # all that follows takes minutes; ./dev soak runs it
        check_runs(ctsplat, testdata)
        return

    def look(browser, name):
        if pictures:
            time.sleep(1)
            browser.screenshot(os.path.join(pictures, name + '.png'))

    with tempfile.TemporaryDirectory() as folder:
        lines = make_batch(ctsplat, testdata, folder)
        page = 'file://' + os.path.join(folder, 'index.html')
        with webdriver.Browser(1400, 900) as browser:
            check_opens(browser, page)
            check_names(browser)
            look(browser, 'light')
            check_search(browser, lines)
            check_filter_and_sort(browser, lines)
            check_labels(browser, lines)
            check_viewer(browser)
            check_keys(browser)
            check_hostile(browser)
            check_width(browser, 'the window')
            check(not browser.messages(), 'the browser complains')
            light = browser.run('return getComputedStyle(document.body).backgroundColor')
        with webdriver.Browser(1400, 900) as browser:
            check_under_way(browser, ctsplat, testdata, os.path.join(folder, 'under-way'))
        with webdriver.Browser(390, 844, dark=True, touch=True) as browser:
            check_opens(browser, page)
            check_width(browser, 'the phone')
            look(browser, 'phone-dark')
            check(browser.run('return getComputedStyle(document.body).backgroundColor') != light, 'dark is light')
            browser.click('#more')
            check_width(browser, 'the phone with filters')
            browser.run('document.querySelector("article:nth-child(3) [data-picture]").click()')
            until(browser, 'document.querySelector(".picture img").naturalWidth === 256', 'the full picture on a phone')
            look(browser, 'phone-viewer')
    print('the contact sheet of', N, 'series')


main()
