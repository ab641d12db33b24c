'use strict';
/* Follows a model while it is written: a new page is loaded, an error is shown above the last good one. */
{
  const { version } = document.currentScript.dataset;
  const banner = document.createElement('div');
  Object.assign(banner, { id: 'watched', hidden: true });
  banner.setAttribute('role', 'alert');
  banner.style.cssText = 'position: sticky; top: 0; z-index: 9; max-height: 50vh; overflow: auto;'
    + 'white-space: pre-wrap; padding: .6rem .8rem; background: var(--bad-tint); color: var(--ink);'
    + 'border-left: 4px solid var(--bad); font: .85rem/1.4 ui-monospace, monospace;';
  document.body.prepend(banner);
  const say = text => {
    banner.textContent = text;
    banner.hidden = !text;
  };

  // The new page stands at the time of the old one.
  const isMoving = typeof player !== 'undefined', moment = sessionStorage.getItem('moment');
  if (isMoving && moment !== null) player.setTime(Number(moment));
  const renew = () => {
    if (isMoving) sessionStorage.setItem('moment', player.state.time);
    location.reload();  // with its fragment
  };

  const events = new EventSource('/events');
  events.onmessage = ({ data }) => {
    const state = JSON.parse(data);
    if (state.version === version) say(state.error);
    else renew();
  };
  events.onerror = () => say('kincompile view --watch has ended: this page stays as it is.');
}
