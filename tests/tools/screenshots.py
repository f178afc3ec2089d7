#!/usr/bin/env python3
"""Screenshots of the server's page and of a contact sheet in a headless Chromium: screenshots.py CTSPLAT OUT CHEST SERIES...

CHEST: a series, shown by the page with preset vessel, and by the sheet beside the other SERIES. Writes OUT/page.jpg and
OUT/sheet.jpg."""
import base64
import os
import subprocess
import sys
import tempfile
import time

here = os.path.dirname(os.path.abspath(__file__))
for folder in 'serve', 'deploy':
    sys.path.insert(0, os.path.join(here, '..', folder))
import webdriver  # noqa: E402
from server import Server  # noqa: E402

ctsplat, out, *series = map(os.path.abspath, sys.argv[1:])
chest = series[0]
QUALITY = 82  # of the JPEG: text stays sharp, files below 250 kB


def until(browser, script, seconds=300):
    end = time.monotonic() + seconds
    while not browser.run('return ' + script):
        assert time.monotonic() < end, script
        time.sleep(0.1)


def shot(browser, name):
    data = browser.devtools('Page.captureScreenshot', {'format': 'jpeg', 'quality': QUALITY})['data']
    with open(os.path.join(out, name), 'wb') as f:
        f.write(base64.b64decode(data))


def page():
    with Server(ctsplat, chest) as server, webdriver.Browser(1200, 850, dark=True, network=True) as browser:
        rests = "document.querySelector('#stage').dataset.rests === 'true'"
        browser.open(server.url)
        until(browser, "document.querySelector('a.card')")
        browser.run("document.querySelector('a.card').click()")
        until(browser, rests)
        browser.run("document.querySelector('[data-name=vessel]').click()")
        until(browser, f"!({rests})")
        until(browser, rests)
        for name, value in ('ArrowLeft', 4), ('ArrowUp', 2), ('=', 2):
            for _ in range(value):
                browser.run("const e = new KeyboardEvent('keydown', {key: arguments[0]});"
                            "document.querySelector('#stage').dispatchEvent(e)", name)
        until(browser, f"!({rests})")
        until(browser, rests)
        until(browser, "[...document.querySelectorAll('#presets img')].every(i => i.naturalWidth > 0)")
        browser.run("document.activeElement.blur()")
        shot(browser, 'page.jpg')


def sheet():
    with tempfile.TemporaryDirectory() as work, webdriver.Browser(1200, 850) as browser:
        subprocess.run([ctsplat, 'batch', *series, '-O', work, '--presets', 'bone,vessel,skin', '--views', 'anterior,left',
                        '--size', '384x384', '--quality', '85', '--formats', 'jpg', '--remove-table', 'on'], check=True)
        browser.open('file://' + work + '/index.html')
        until(browser, "[...document.images].every(i => i.loading === 'lazy' || i.complete)")
        shot(browser, 'sheet.jpg')


os.chdir(tempfile.mkdtemp())
page()
sheet()
