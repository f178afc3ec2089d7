"""A headless Chromium, spoken to through chromedriver with the standard library alone."""
import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import urllib.error
import urllib.request

ELEMENT = 'element-6066-11e4-a52e-4f735466cecf'
KEYS = {'Enter': '\ue007', 'Escape': '\ue00c', 'Space': ' ', 'Left': '\ue012', 'Up': '\ue013', 'Right': '\ue014',
        'Down': '\ue015', 'Tab': '\ue004', 'Home': '\ue011', 'End': '\ue010'}


def missing():
    """The missing program, or None."""
    for program in ('chromium', 'chromedriver'):
        if not shutil.which(program):
            return program
    return None


class Browser:
    def __init__(self, width=1400, height=900, dark=False, touch=False, network=False):
        self.folder = tempfile.mkdtemp(prefix='browser-')
        self.log = open(os.path.join(self.folder, 'chromedriver.log'), 'wb')
        self.driver = subprocess.Popen(['chromedriver', '--port=0'], stdout=subprocess.PIPE, stderr=self.log, text=True)
        self.session = None
        for line in self.driver.stdout:
            found = re.search(r'started successfully on port (\d+)', line)
            if found:
                break
        else:
            raise RuntimeError('chromedriver does not start')
        self.base = f'http://127.0.0.1:{found[1]}'
        arguments = ['--headless=new', '--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage', '--hide-scrollbars',
                     f'--user-data-dir={self.folder}/profile', f'--window-size={width},{height}',
                     '--host-resolver-rules=MAP * ~NOTFOUND' + ', EXCLUDE 127.0.0.1' * network, '--disable-background-networking',
                     '--force-device-scale-factor=1']
        options = {'args': arguments, 'binary': shutil.which('chromium')}
        options['perfLoggingPrefs'] = {'enableNetwork': True}
        answer = self.call('POST', '/session', {'capabilities': {'alwaysMatch': {
            'goog:chromeOptions': options, 'goog:loggingPrefs': {'browser': 'ALL', 'performance': 'ALL'}}}})
        self.session = f'/session/{answer["sessionId"]}'
        self.devtools('Emulation.setEmulatedMedia',
                      {'features': [{'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}]})
        self.devtools('Emulation.setDeviceMetricsOverride',
                      {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': touch})

    def call(self, method, path, body=None):
        data = json.dumps(body if body is not None else {}).encode() if method == 'POST' else None
        request = urllib.request.Request(self.base + path, data, {'Content-Type': 'application/json'}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)['value']
        except urllib.error.HTTPError as e:
            raise RuntimeError(json.load(e)['value']['message'].split('\n')[0]) from None

    def devtools(self, command, parameters):
        return self.call('POST', f'{self.session}/goog/cdp/execute', {'cmd': command, 'params': parameters})

    def open(self, url):
        self.call('POST', f'{self.session}/url', {'url': url})

    def run(self, script, *arguments):
        """The value of a JavaScript function's body; a promise is waited for."""
        return self.call('POST', f'{self.session}/execute/sync', {'script': script, 'args': list(arguments)})

    def find(self, selector):
        return self.call('POST', f'{self.session}/element', {'using': 'css selector', 'value': selector})[ELEMENT]

    def click(self, selector):
        self.call('POST', f'{self.session}/element/{self.find(selector)}/click')

    def type(self, selector, text):
        self.call('POST', f'{self.session}/element/{self.find(selector)}/value', {'text': text})

    def press(self, *keys):
        """Keys for whatever has the focus."""
        actions = [{'type': kind, 'value': KEYS.get(key, key)} for key in keys for kind in ('keyDown', 'keyUp')]
        self.call('POST', f'{self.session}/actions', {'actions': [{'type': 'key', 'id': 'keys', 'actions': actions}]})

    def hover(self, selector):
        place = {ELEMENT: self.find(selector)}
        move = {'type': 'pointerMove', 'duration': 0, 'x': 0, 'y': 0, 'origin': place}
        mouse = {'type': 'pointer', 'id': 'mouse', 'actions': [move]}
        self.call('POST', f'{self.session}/actions', {'actions': [mouse]})

    def messages(self):
        """The page's console messages since the last call."""
        return [m['message'] for m in self.call('POST', f'{self.session}/se/log', {'type': 'browser'})]

    def requests(self):
        """Addresses requested since the last call."""
        found = []
        for entry in self.call('POST', f'{self.session}/se/log', {'type': 'performance'}):
            message = json.loads(entry['message'])['message']
            if message['method'] == 'Network.requestWillBeSent':
                found.append(message['params']['request']['url'])
        return found

    def screenshot(self, path):
        with open(path, 'wb') as f:
            f.write(base64.b64decode(self.call('GET', f'{self.session}/screenshot')))

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        try:
            if self.session:
                self.call('DELETE', self.session)
        finally:
            self.driver.terminate()
            self.driver.wait()
            self.driver.stdout.close()
            self.log.close()
            shutil.rmtree(self.folder, ignore_errors=True)
